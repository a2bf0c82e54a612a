"""Pages as text: their figures, what their scripts get, and what a person reads."""

import base64
import html
import json
import re

import numpy as np

from vibroplat.page.report import Report
from vibroplat.page.results import find_results


def page_of(*directories, **options):
    return Report(find_results(list(directories)), **options).page()


def read(text):
    """What a person reads without scripts, in one line."""
    text = re.sub(r"<(style|script|template)[^>]*>.*?</\1>", " ", text, flags=re.DOTALL)
    return " ".join(html.unescape(re.sub(r"<[^>]+>", " ", text)).split())


def data_of(text, number=0):
    """What the script gets of a study."""
    section = text[text.index(f'id="picture-{number}"') :]
    return json.loads(re.search(r'class="data">(.*?)</script>', section, re.DOTALL).group(1))


def frames_of(text):
    return json.loads(re.search(r'id="frames">(.*?)</script>', text, re.DOTALL).group(1))


def unpacked(column, count=0):
    """Numbers that were packed."""
    low, high, text = column
    if not text:
        return np.full(count, low)
    parts = np.frombuffer(base64.b64decode(text), "<u2").astype(float)
    return np.where(parts == 65535, np.nan, low + (high - low) * parts / 65534)


class Figure:
    def __init__(self, text):
        self.text = text
        self.title = html.unescape(re.search(r"<figcaption><b>(.*?)</b>", text).group(1))
        self.axes = [re.search(rf'data-{name}="(\S+) (\S+) (\w+)"', text).groups() for name in "xy"]
        self.unit, self.x_unit = (
            html.unescape(re.search(rf'data-{name}="(.*?)"', text).group(1)) for name in ("u", "xu")
        )
        self.names = [html.unescape(name) for name in re.findall(r'data-n="(.*?)"', text)]

    def ends(self, axis):
        """Ends of an axis: 0 the horizontal one, 1 the vertical one."""
        return [float(end) for end in self.axes[axis][:2]]

    def points(self, name):
        """Points of a curve, or of dots, in the units of the axes."""
        line = re.search(rf'data-n="{re.escape(html.escape(name))}"[^>]* d="(.*?)"', self.text).group(1)
        found = []
        for part in line.split("M")[1:]:
            steps = np.array(re.findall(r"-?\d+", part.replace("h0", " ")), dtype=int).reshape(-1, 2).cumsum(axis=0)
            found.append(steps)
        places = np.concatenate(found) / (10_000, 3_000)
        (left, right), (low, high) = self.ends(0), self.ends(1)
        return np.column_stack([left + (right - left) * places[:, 0], high - (high - low) * places[:, 1]])

    @property
    def hits(self):
        """Numbers on the page of the points that a click finds."""
        found = re.search(r"data-p='(.*?)'", self.text)
        parts = np.frombuffer(base64.b64decode(found.group(1)), "<u2") if found else np.zeros(0, int)
        return parts[: len(parts) // 3].tolist()


def figures_of(text):
    """Figures of a page, or of a part of it, by their titles; the first of those with one title."""
    found = [Figure(part) for part in re.findall(r"<figure class=\"plot.*?</figure>", text, re.DOTALL)]
    titles = dict.fromkeys(one.title for one in found)
    return {title: next(one for one in found if one.title == title) for title in titles}
