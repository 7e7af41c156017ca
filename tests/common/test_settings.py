"""Settings are declared once: signatures, docstrings, options and checks follow."""

from __future__ import annotations

import inspect
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import pytest

from mirrorfold.common.settings import REQUIRED, Settings, setting, takes
from mirrorfold.common.units import Length
from mirrorfold.errors import InputError


@dataclass(frozen=True)
class Window(Settings):
    width: float = setting(0.5, "Width of the window.", unit="m", kind="float", above=0.0, below=2.0)
    shape: str = setting("hann", "Its shape.", choices=("hann", "uniform"))
    order: int = setting(3, "Of the filter.", kind="int", lowest=1)
    strict: bool = setting(False, "Whether to stop at the first error.", kind="bool")
    level: float | None = setting(None, "Found from the data by default.", unit="dB", kind="float")
    places: Any = setting(None, "Where to look.", unit="m", kind="1D array", option=False)


@dataclass(frozen=True)
class Wider(Window):
    width: float = setting(1.5, "Width of the wider window.", unit="m", kind="float")


@takes(Window)
def smooth(image, *, progress=None, **given):
    """Smooth an image.

    Parameters
    ----------
    image : array
    progress : callable, optional
    **given

    Returns
    -------
    tuple
    """
    return image, progress, given


@takes(Window, without=("order",), options=True)
def verb(image: str, *, shape: int = 2, **given: Any) -> tuple[int, dict[str, Any]]:
    """Smooth.

    Parameters
    ----------
    image
        To read.
    shape
        The verb's own.
    **given
    """
    return shape, given


@takes(Window, without=("places",))
class Smoother:
    """Smooths.

    Parameters
    ----------
    image : array
    **given
    """

    def __init__(self, image, **given):
        self.image, self.settings = image, Window().with_given(**given)


def test_the_signature_lists_every_setting_with_its_default():
    parameters = inspect.signature(smooth).parameters
    assert list(parameters) == ["image", "progress", "width", "shape", "order", "strict", "level", "places"]
    assert [p.default for p in list(parameters.values())[2:]] == [0.5, "hann", 3, False, None, None]
    assert all(p.kind is p.KEYWORD_ONLY for p in list(parameters.values())[1:])
    assert parameters["width"].annotation == "float"
    assert list(inspect.signature(Smoother).parameters) == ["image", "width", "shape", "order", "strict", "level"]


def test_the_docstring_has_the_settings_in_their_place():
    text = inspect.getdoc(smooth)
    assert "**given" not in text
    assert "width : float [m], default 0.5\n    Width of the window.\n" in text
    assert 'shape : {"hann", "uniform"}, default \'hann\'\n' in text
    assert "level : float [dB], optional\n" in text
    assert text.index("progress :") < text.index("width :") < text.index("Returns")
    assert "order : int, default 3" in inspect.getdoc(Smoother)
    assert "places" not in inspect.getdoc(Smoother)


def test_only_what_is_given_reaches_the_function():
    assert smooth(1) == (1, None, {})
    assert smooth(1, width=0.5, level=None) == (1, None, {"width": 0.5})
    assert smooth(image=1, progress=2, places=[0.0]) == (1, 2, {"places": [0.0]})
    assert Smoother(7, width=1.0).settings == Window(width=1.0)


def test_an_unknown_keyword_is_refused_with_the_name_of_the_function():
    with pytest.raises(TypeError, match=r"smooth\(\) got an unexpected keyword argument 'witdh'"):
        smooth(1, witdh=2.0)


def test_options_of_the_command_line_have_types_that_it_can_read():
    parameters = inspect.signature(verb).parameters
    assert list(parameters) == ["image", "shape", "width", "strict", "level"]
    assert parameters["width"].annotation is Length
    assert parameters["strict"].annotation is bool
    assert parameters["level"].annotation == float | None
    assert verb("a", shape=5, width=1.0) == (5, {"width": 1.0})
    assert "width\n    Width of the window [m].\n" in inspect.getdoc(verb)
    assert "The verb's own." in inspect.getdoc(verb)
    assert "Its shape." not in inspect.getdoc(verb)

    @takes(Window, options=True)
    def other(**given: Any) -> None:
        """Nothing."""

    assert inspect.signature(other).parameters["shape"].annotation == Literal["hann", "uniform"]


def test_of_two_declarations_the_last_one_counts():
    @takes(Window, Wider)
    def smooth_widely(**given):
        """Smooth.

        **given
        """
        return given

    assert inspect.signature(smooth_widely).parameters["width"].default == 1.5
    assert "wider window" in inspect.getdoc(smooth_widely)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"width": 0.0}, "width is 0.0, expected a finite number [m] above 0 and below 2"),
        ({"width": 2.0}, "width is 2.0"),
        ({"width": np.nan}, "width is nan"),
        ({"width": "wide"}, "width is 'wide'"),
        ({"width": True}, "width is True"),
        ({"shape": "kaiser"}, "shape is 'kaiser', expected one of hann, uniform"),
        ({"shape": np.ones(2)}, "shape is an array of shape"),
        ({"order": 1.5}, "order is 1.5, expected a whole number of at least 1"),
        ({"order": 0}, "order is 0"),
        ({"strict": 1}, "strict is 1, expected True or False"),
        ({"level": np.inf}, "level is inf, expected a finite number [dB]; leave it out for the default"),
    ],
)
def test_a_value_out_of_range_is_named(given, words):
    with pytest.raises(InputError) as refusal:
        Window().with_given(**given)
    assert words in str(refusal.value)


@pytest.mark.parametrize(
    "given", [{"width": np.float32(1.0)}, {"order": np.int64(2)}, {"order": 2.0}, {"strict": np.True_}, {"level": -20}]
)
def test_numbers_of_numpy_are_numbers(given):
    assert getattr(Window().with_given(**given), next(iter(given))) == next(iter(given.values()))


def test_given_settings_replace_others_and_none_does_not():
    assert Window(width=1.0).with_given(width=None, order=5) == Window(width=1.0, order=5)
    assert list(Window.rules()) == ["width", "shape", "order", "strict", "level", "places"]


def test_numbers_become_those_of_their_kind():
    """NumPy takes whole numbers beyond 64 bits for objects, and Python counts with no others."""
    chosen = Window(width=np.float32(1.5), order=2.0, level=10**20)
    assert [type(value) for value in (chosen.width, chosen.order, chosen.level)] == [float, int, float]


@dataclass(frozen=True, kw_only=True)
class Band(Settings):
    start: float = setting(REQUIRED, "Lowest frequency.", unit="Hz", kind="float", above=0.0)


def test_a_setting_without_a_default_must_be_given():
    @takes(Window, Band)
    def sweep(*, name="sweep", **given):
        """Sweep.

        Parameters
        ----------
        **given
        """
        return name, given

    parameters = inspect.signature(sweep).parameters
    assert next(iter(parameters)) == "start"
    assert parameters["start"].default is inspect.Parameter.empty
    assert "start : float [Hz]\n    Lowest frequency.\n" in f"{sweep.__doc__}\n"
    with pytest.raises(TypeError, match="start"):
        sweep()
    assert sweep(start=None) == ("sweep", {"start": None})  # is refused where it is used, by its name
    assert Band(start=3).start == 3.0
