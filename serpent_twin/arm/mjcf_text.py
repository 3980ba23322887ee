"""Write MJCF as text."""

import xml.etree.ElementTree as ET
from typing import Any

import numpy as np


def text(document: ET.Element) -> str:
    """The document, indented."""
    ET.indent(document)
    return ET.tostring(document, encoding="unicode") + "\n"


def add(parent: ET.Element, tag: str, **attributes: Any) -> ET.Element:
    """Append an element; an underscore that ends an attribute's name is left out."""
    words = {name.rstrip("_"): word(value) for name, value in attributes.items()}
    return ET.SubElement(parent, tag, words)


def word(value: Any) -> str:
    """An attribute's value: a text as it is, numbers and vectors with nine digits."""
    if isinstance(value, str):
        return value
    numbers = [value] if isinstance(value, float) else np.atleast_1d(value).tolist()
    return " ".join(f"{round(number, 12) + 0.0:.9g}" for number in numbers)
