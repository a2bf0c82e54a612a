"""Compiled code: how kernels are compiled, calls of C functions, small linear algebra."""
