"""Every request gives a result or an exception, never a crash of Python."""

import itertools
import math

import nanotap
import numpy as np
import pytest

NAN, INF = math.nan, math.inf

REFUSED = [
    ("scan", {"lock_in": "20 us"}, TypeError, "lock_in: expected a dictionary"),
    ("scan", {"lock_in": {"time": "20 us"}}, ValueError, "lock_in: unknown field"),
    ("scan", {"surface": [{"hill": 1}]}, ValueError, "surface: unknown variant"),
    ("simulate", {"periods": 0}, ValueError, "periods: 0 is out of range"),
    ("simulate", {"periods": -1}, ValueError, "periods: -1 is out of range"),
    ("simulate", {"periods": 2**64}, ValueError, "out of range"),
    ("simulate", {"periods": 2.0}, TypeError, "periods: expected a whole number"),
    ("simulate", {"periods": True}, TypeError, "periods"),
    ("simulate", {"periods": None}, TypeError, "periods"),
    (
        "simulate",
        {"state": [1, 2]},
        ValueError,
        "the state has 2 numbers where 6 are needed",
    ),
    ("simulate", {"state": [NAN] * 6}, ValueError, "state: `nan`"),
    ("simulate", {"state": [[[0] * 6]]}, ValueError, "one state, or one per row"),
    ("simulate", {"state": ["a"] * 6}, TypeError, "state: expected real numbers"),
    ("simulate", {"state": [1j] * 6}, TypeError, "state"),
    ("simulate", {"state": [[1], [2, 3]]}, ValueError, "state"),
    ("simulate", {"max_period": 0}, ValueError, "max_period"),
    ("simulate", {"resolution": 0}, ValueError, "resolution"),
    ("simulate", {"resolution": 10**9}, ValueError, "too many"),
    ("simulate", {"series": 10**12}, ValueError, "too many"),
    ("simulate", {"method": "euler"}, ValueError, "there are exact, rk4"),
    ("simulate", {"method": "rk4", "steps": 0}, ValueError, "steps"),
    ("simulate", {"method": "rk4", "steps": [1, 2, 3]}, ValueError, "steps"),
    ("simulate", {"method": "rk4", "steps": 2**40}, ValueError, "steps"),
    ("simulate", {"method": "rk4", "switching": "x"}, ValueError, "switching"),
    ("simulate", {"omgea": 2}, ValueError, "did you mean `omega`"),
    ("simulate", {"omega": [2, NAN]}, ValueError, "finite"),
    ("simulate", {"omega": [[2, 3]]}, ValueError, "a row of values"),
    ("simulate", {"omega": np.array([])}, ValueError, "a row of values"),
    ("simulate", {"omega": ["a", "b"]}, ValueError, "text, not a number"),
    ("simulate", {"omega": [2, 3], "threads": 0}, ValueError, "threads"),
    ("orbit", {"period": 0}, ValueError, "period: 0 is out of range"),
    ("orbit", {"omega": 2.6}, RuntimeError, "not periodic"),
    ("orbit", {"harmonics": 2**50}, ValueError, "harmonics"),
    ("attractors", {"starts": 0}, ValueError, "starts: 0 is out of range"),
    ("attractors", {"starts": 2**60}, ValueError, "starts"),
    ("attractors", {"box": {"b1": (0, 1)}}, ValueError, "no coordinate `b1`"),
    ("attractors", {"box": {"a1": (1, 0)}}, ValueError, "a1|side"),
    ("attractors", {"box": {"a1": (NAN, 1)}}, ValueError, "."),
    ("attractors", {"box": {"a1": (0, 1, 2)}}, ValueError, "a lower and an upper end"),
    ("attractors", {"box": {"a1": 3}}, TypeError, "a lower and an upper end"),
    ("attractors", {"box": ["a1"]}, ValueError, "write it as in a1=-1:1"),
    ("attractors", {"box": 3}, TypeError, "name the sides"),
    ("attractors", {"seed": -1}, ValueError, "seed"),
    ("sweep", {"over": "omgea=2:3:4"}, ValueError, "did you mean `omega`"),
    ("sweep", {"over": "omega"}, ValueError, "omega"),
    ("sweep", {"over": 3}, TypeError, "over"),
    ("sweep", {"over": {"omega": nanotap.range(2, NAN, 4)}}, ValueError, "."),
    ("sweep", {"over": {"omega": nanotap.range(2, 3, 0)}}, ValueError, "."),
    ("sweep", {"over": {"omega": (2, 3, 2**62)}}, ValueError, "."),
    ("sweep", {"over": {"omega": nanotap.range(-1, 3, 4)}}, ValueError, "."),
    ("sweep", {"over": {"omega": (2, 3, 4, "cubic")}}, ValueError, "."),
    (
        "sweep",
        {
            "over": {
                "omega": nanotap.range(2, 3, 4),
                "alpha4": nanotap.range(1, 2, 2),
                "gap": nanotap.range(0, 1, 2),
            }
        },
        ValueError,
        ".",
    ),
    (
        "sweep",
        {"over": {"omega": nanotap.range(2, 3, 4)}, "follow": "sideways"},
        ValueError,
        "there are off, up, down, both",
    ),
    (
        "sweep",
        {"over": {"omega": nanotap.range(2, 3, 4)}, "periods": 0},
        ValueError,
        ".",
    ),
    (
        "sweep",
        {"over": {"omega": nanotap.range(2, 3, 4)}, "periods": 2**62},
        ValueError,
        ".",
    ),
    (
        "sweep",
        {"over": {"omega": nanotap.range(2, 3, 4)}, "starts": 0},
        ValueError,
        ".",
    ),
    (
        "sweep",
        {"over": {"omega": nanotap.range(2, 3, 4)}, "starts": 2**62},
        ValueError,
        ".",
    ),
    (
        "sweep",
        {"over": {"omega": nanotap.range(2, 3, 4)}, "chunk": "3/2"},
        ValueError,
        "is not a share",
    ),
    (
        "sweep",
        {"over": {"omega": nanotap.range(2, 3, 4)}, "out": "x.csv"},
        ValueError,
        "use .zarr",
    ),
    ("basin", {"x": "a1=-1:1:4", "y": "a1=-1:1:4"}, ValueError, "."),
    ("basin", {"x": "a9=-1:1:4", "y": "v1=-1:1:4"}, ValueError, "a9"),
    ("basin", {"x": "a1=-1:1:4", "y": {}}, TypeError, "name one entry"),
    ("basin", {"x": "a1=-1:1:4000000", "y": "v1=-1:1:4000000"}, ValueError, "."),
    (
        "basin",
        {"x": "a1=-1:1:4", "y": "v1=-1:1:4", "starts": 2**50},
        ValueError,
        "starts",
    ),
    (
        "basin",
        {"x": "a1=-1:1:4", "y": "v1=-1:1:4", "attractors": [[1, 2]]},
        ValueError,
        "2 numbers",
    ),
    (
        "branch",
        {"parameter": "omgea", "from_": 2, "to": 3},
        ValueError,
        "no parameter `omgea`",
    ),
    ("branch", {"parameter": "omega", "from_": 3, "to": 3}, ValueError, "."),
    ("branch", {"parameter": "omega", "from_": NAN, "to": 3}, ValueError, "."),
    (
        "branch",
        {"parameter": "omega", "from_": "70 kHz", "to": 3},
        ValueError,
        "not a number",
    ),
    (
        "branch",
        {"parameter": "omega", "from_": 3, "to": 2, "max_step": INF},
        ValueError,
        ".",
    ),
    (
        "branch",
        {"parameter": "omega", "from_": 3, "to": 2, "second": 3},
        TypeError,
        "second",
    ),
    (
        "branch",
        {"parameter": "omega", "from_": 3, "to": 2, "diagram": True, "values": 1},
        ValueError,
        "values: 1 is out of range",
    ),
    ("lyapunov", {"phase": NAN}, ValueError, "phase: `nan`"),
    ("lyapunov", {"section": "x"}, ValueError, "there are phase, contact"),
    ("lyapunov", {"points": 2**60}, ValueError, "points"),
    ("convergence", {"largest": 1}, ValueError, "from 2 to 50"),
    ("convergence", {"largest": 51}, ValueError, "from 2 to 50"),
    ("convergence", {"tolerance": NAN}, ValueError, "tolerance"),
    ("approach", {"points": 1}, ValueError, "from 2 to"),
    ("approach", {"from_": 0, "to": 1}, ValueError, "from far to near"),
    ("approach", {"from_": "30 nm"}, ValueError, "not a number"),
    ("modes", {"points": 1}, ValueError, "points"),
    ("modes", {"points": 2**60}, ValueError, "points"),
]


@pytest.mark.parametrize(("name", "arguments", "kind", "words"), REFUSED)
def test_bad_input_is_refused_with_a_reason(regular, name, arguments, kind, words):
    with pytest.raises(kind, match=words):
        getattr(nanotap, name)(regular, **arguments)


@pytest.mark.parametrize(
    "name",
    [
        "simulate",
        "orbit",
        "attractors",
        "sweep",
        "basin",
        "branch",
        "lyapunov",
        "convergence",
        "modes",
    ],
)
def test_what_is_no_case_is_a_type_error(name):
    needed = {
        "sweep": {"over": "omega=2:3:4"},
        "basin": {"x": "a1=-1:1:4", "y": "v1=-1:1:4"},
        "branch": {"parameter": "omega", "from_": 2, "to": 3},
    }
    with pytest.raises(TypeError, match="expected a nanotap.Case"):
        getattr(nanotap, name)({"omega": 3}, **needed.get(name, {}))


def test_no_combination_of_odd_numbers_ends_python():
    """Cases with extreme numbers: a result, or one of the documented errors."""
    odd = [0.0, -0.0, 1e-9, 1e3, 1e308, -1.0, NAN, INF]
    keys = ["alpha1", "alpha2", "alpha3", "alpha4", "alpha5", "alpha6", "omega"]
    tried = made = 0
    for key, value in itertools.product(keys, odd):
        for modes in (1, 3):
            tried += 1
            try:
                case = nanotap.Case.paper(**{key: value, "modes": modes})
                made += 1
                nanotap.simulate(case, periods=2, transient=0, max_period=2, series=1)
                nanotap.modes(case)
            except (ValueError, RuntimeError) as error:
                assert str(error) and "mistake inside" not in str(error), (
                    key,
                    value,
                    error,
                )
    assert tried == 112 and made > 30


def test_odd_arrays_are_read_as_what_they_are(regular):
    state = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
    plain = nanotap.simulate(
        regular, state=state, periods=3, transient=0, strobe=3
    ).strobe
    twice = np.zeros(12)
    twice[::2] = state
    buffer = np.zeros(49, dtype=np.uint8)
    misaligned = buffer[1:].view(np.float64)
    misaligned[:] = state
    for odd in (
        twice[::2],
        np.array(state)[::-1][::-1],
        np.array(state, dtype=">f8"),
        misaligned,
        tuple(state),
    ):
        run = nanotap.simulate(regular, state=odd, periods=3, transient=0, strobe=3)
        np.testing.assert_array_equal(run.strobe, plain)
    whole = nanotap.simulate(regular, state=np.arange(6), periods=3, transient=0)
    assert np.isfinite(whole.tip_max)
