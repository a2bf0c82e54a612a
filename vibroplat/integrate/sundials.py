"""The SUNDIALS library inside the scikit-sundae wheel, opened directly.

scikit-sundae's extension module for IDA is linked with IDA's shared library, and the loader resolves its public
functions through it. Only public functions are declared here, with the types of SUNDIALS 7 and of the configuration
that scikit-sundae reports.
"""

from __future__ import annotations

import ctypes
import importlib.util
import re
from functools import cache
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path
from typing import Any

_MODULE = "_cy_ida"
_MAJOR = "7."
_TYPES = {"SUNDIALS_FLOAT_TYPE": "double", "SUNDIALS_INT_TYPE": "int"}

# Result and arguments of every function that is used: p pointer, i int, r real, n index, v nothing.
_KINDS = {"p": ctypes.c_void_p, "i": ctypes.c_int, "r": ctypes.c_double, "n": ctypes.c_int32, "v": None}
_FUNCTIONS = {
    "SUNContext_Create": "iip",
    "SUNContext_Free": "ip",
    "SUNContext_ClearErrHandlers": "ip",
    "SUNContext_GetLogger": "ipp",
    "SUNLogger_SetErrorFilename": "ipp",
    "SUNLogger_SetWarningFilename": "ipp",
    "SUNDIALSGetVersion": "ipi",
    "N_VMake_Serial": "pnpp",
    "N_VDestroy": "vp",
    "N_VEnableFusedOps_Serial": "ipi",
    "N_VGetArrayPointer": "pp",
    "SUNDenseMatrix": "pnnp",
    "SUNMatDestroy": "vp",
    "SUNLinSol_Dense": "pppp",
    "SUNLinSolFree": "ip",
    "SUNLinSolSetup_Dense": "ipp",
    "SUNLinSolSolve_Dense": "ippppr",
    "IDACreate": "pp",
    "IDAFree": "vp",
    "IDAInit": "ipprpp",
    "IDAReInit": "iprpp",
    "IDARootInit": "ipip",
    "IDAWFtolerances": "ipp",
    "IDASetDeltaCjLSetup": "ipr",
    "IDASetEtaFixedStepBounds": "iprr",
    "IDASetEtaMax": "ipr",
    "IDASetId": "ipp",
    "IDASetInitStep": "ipr",
    "IDASetJacFn": "ipp",
    "IDASetLinearSolver": "ippp",
    "IDASetNoInactiveRootWarn": "ip",
    "IDASetRootDirection": "ipp",
    "IDASetSuppressAlg": "ipi",
    "IDASetUserData": "ipp",
    "IDASolve": "iprpppi",
    "IDAGetDky": "iprip",
    "IDAGetNumErrTestFails": "ipp",
    "IDAGetNumNonlinSolvConvFails": "ipp",
}


class UnavailableError(RuntimeError):
    """The library is not one that this engine knows; the message says why."""


def package() -> Path:
    """Return the directory of scikit-sundae, found without importing it and what it imports.

    Raises
    ------
    UnavailableError
        It is not installed.
    """
    spec = importlib.util.find_spec("sksundae")
    if spec is None or spec.origin is None:
        raise UnavailableError("scikit-sundae is not installed")
    return Path(spec.origin).parent


def configuration() -> dict[str, str]:
    """Read what scikit-sundae says of the library it was built with: version and number types.

    Raises
    ------
    UnavailableError
        It does not say so.
    """
    try:
        text = (package() / "py_config.pxi").read_text(encoding="utf-8")
    except OSError as error:
        raise UnavailableError(f"scikit-sundae does not report its configuration ({error})") from None
    return dict(re.findall(r'^(\w+) = "(.*)"$', text, flags=re.MULTILINE))


class Library:
    """Functions of IDA by name, with their addresses.

    Attributes
    ----------
    version
        Of SUNDIALS.

    Raises
    ------
    UnavailableError
        A module, a symbol or a type is not as expected.
    """

    def __init__(self) -> None:
        settings = configuration()
        types = {name: settings.get(name) for name in _TYPES}
        if types != _TYPES:
            raise UnavailableError(f"its number types are {', '.join(map(str, types.values()))}; known: double, int")
        opened = _open()
        self._functions: dict[str, Any] = {}
        for name, kinds in _FUNCTIONS.items():
            if not hasattr(opened, name):
                raise UnavailableError(f"SUNDIALS function {name} is missing")
            function = self._functions[name] = getattr(opened, name)
            function.restype, *function.argtypes = (_KINDS[kind] for kind in kinds)
        text = ctypes.create_string_buffer(64)
        self.SUNDIALSGetVersion(ctypes.cast(text, ctypes.c_void_p), len(text))
        self.version = text.value.decode()
        if not self.version.startswith(_MAJOR):
            raise UnavailableError(f"SUNDIALS {self.version} is not known; known: {_MAJOR}x")

    def __getattr__(self, name: str) -> Any:
        try:
            return self._functions[name]
        except KeyError:
            raise AttributeError(name) from None

    def address(self, name: str) -> int:
        """Address of a function, for calls from compiled code."""
        return ctypes.cast(self._functions[name], ctypes.c_void_p).value or 0


def _open() -> ctypes.CDLL:
    """Open the extension module as a library; its dependencies' functions are found through it."""
    paths = [path for suffix in EXTENSION_SUFFIXES if (path := package() / f"{_MODULE}{suffix}").exists()]
    if not paths:
        raise UnavailableError(f"scikit-sundae has no {_MODULE}")
    try:
        return ctypes.CDLL(str(paths[0]))
    except OSError as error:
        raise UnavailableError(f"{paths[0].name} cannot be opened ({error})") from None


@cache
def library() -> Library:
    """Open the library once; raises :class:`UnavailableError` as :class:`Library` does."""
    return Library()
