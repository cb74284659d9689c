"""Nonsense as arguments of the public functions: each is refused by a `UserError` that begins with the function's name
and names the argument."""

from __future__ import annotations

import inspect
import math
import re
import warnings

import jax.numpy as jnp
import numpy as np
import pytest
import scipy.sparse as sp
from refusals import refused

import microslip as ms
from microslip.contact.friction import Coulomb
from microslip.errors import UserError
from microslip.rolling.ellipse import Elastic

NAN, INF = math.nan, math.inf
RAGGED = [[1.0], [1.0, 2.0]]
NUMBER = ["x", "1", NAN, INF, [], {}, None, RAGGED, object(), 1e200, 1j, True]
NOT_NEGATIVE = [*NUMBER, -1.0]
POSITIVE = [*NOT_NEGATIVE, 0.0]
WHOLE = ["x", NAN, INF, 1.5, -1, [], {}, None, True]
COUNT = [*WHOLE, 0]
WORD = ["nonsense", 3, [], None, NAN]
TEXT = [3, [], NAN, ""]
TRUTH = ["x", 3, None, NAN]
SYSTEM = ["x", 3.0, None, [], NAN]
FUNCTION = ["x", 3.0, None]
MATRIX = ["x", NAN, INF, [], {}, None, RAGGED, [["a"]], np.zeros((2, 3)), np.zeros((1, 1, 1)), 1e200]
FREQUENCIES = ["x", NAN, INF, [], None, {}, -1.0, 0.0, [[0.1, 0.2]], ["a"], [0.1, NAN], object(), 1e200, 1j]
PLACE = ["x", NAN, INF, {}, 1.5, -1]
FILE = [3.0, None, [], NAN]
FORCE = ["x", NAN, {0: NAN}, {0: "a"}, {"a": 1.0}, {0: None}, {0: INF}, [], [1.0, 2.0], {1.5: 1.0}, {0: [1.0]},
         {NAN: 1.0}, {0: 1e200}, {-1: 1.0}]  # fmt: skip


def without_none(kind):
    """Of an argument that may be left out."""
    return [v for v in kind if v is not None]


def optional(**kinds):
    return {key: without_none(kind) for key, kind in kinds.items()}


SLIDER = ms.structure(1.0, 1.0, 0.1, force={0: 0.3}, elements=[ms.jenkins(1.0, 0.5)])
TWO = ms.structure(1.0, 1.0, 0.1, force={0: 0.2}, second_force={0: 0.1}, elements=[ms.polynomial({3: 0.05})])
FLUTTER = [[3, 1], [1, 1]], [[0, 0], [0, 0]], [[-1, 2], [-1, 1]]
BALANCE = optional(harmonics=COUNT, samples=COUNT) | {"report": FUNCTION}


def rate(x, p, angle):
    return -x


def dynamics(**more):
    return ms.Dynamics(**({"rate": rate, "labels": ("x", "y"), "scale": np.ones(2)} | more))


BRUSSELATOR = dynamics()
STATE = {"xi": 1e-3, "eta": 0.0, "phi": 0.1, "a": 8e-3, "b": 4e-3, "normal_force": 8e4, "friction": 0.3, "shear": 8e10,
         "poisson": 0.28}  # fmt: skip
POISSON, FRICTION = [*NOT_NEGATIVE, 0.7], [*NOT_NEGATIVE, 30.0]
STATES = {"xi": NUMBER, "eta": NUMBER, "phi": NUMBER, "a": POSITIVE, "b": POSITIVE, "normal_force": POSITIVE,
          "friction": FRICTION, "shear": POSITIVE, "poisson": POISSON}  # fmt: skip
MODEL = {"elements": [20, "ab", None, (20.5, 20), (1, 4), (20,), (NAN, 4), [[4, 4]]], "distribution": WORD,
         "coefficients": WORD}  # fmt: skip
ARC = ms.circle(0.3)
TRACK = ms.Track(ms.circle(0.5), ARC, 0.46, 0.75, 0.75, Elastic(1e11, 8e10, 0.28))
SHARED = {"pose": [3, None, "x"], "vertical": NOT_NEGATIVE, "friction": FRICTION, "track": SYSTEM}

CALLS = [
    (ms.fastsim, STATE, {
        **{key: [*kind, [0.1, 0.2]] for key, kind in STATES.items()}, "elements": MODEL["elements"], "bound": WORD,
        "cover": [*POSITIVE, 0.5], "blend": TRUTH,
    }),
    *((model, STATE, {**STATES, **MODEL, "spin": WORD}) for model in (ms.creep_forces, ms.tractions)),
    (ms.forces_by_characteristic, {**STATE, "friction": Coulomb(0.3), "speed": 20.0},
     {**STATES, **MODEL, "spin": WORD, "speed": POSITIVE, "friction": SYSTEM, "surface": ["x", 3.0]}),
    (ms.creep_coefficients, {"ratio": 1.0, "poisson": 0.3}, {"ratio": POSITIVE, "poisson": POISSON, "source": WORD}),
    (ms.ellipses, {"A": 1.0, "B": 1.0, "force": 1e4, "modulus": 1e11},
     {"A": POSITIVE, "B": POSITIVE, "force": NOT_NEGATIVE, "modulus": [*POSITIVE, [1e11]]}),
    (ms.circle, {"radius": 0.3}, {"radius": NUMBER, "width": POSITIVE}),
    (ms.read_profile, {"path": "x"}, {
        "path": FILE, "noise": NOT_NEGATIVE, "unit": POSITIVE, "mirror": WORD,
        "between": ["x", 3.0, None, (1.0,), (2.0, 1.0), (NAN, 1.0), {}],
    }),
    (ms.Track, vars(TRACK), {
        "wheel": SYSTEM, "rail": SYSTEM, "radius": POSITIVE, "wheel_at": POSITIVE, "rail_at": POSITIVE,
        "elastic": [*SYSTEM, (1e11, 8e10, 0.28)],
    }),
    (ms.Pose, {}, {"lateral": NUMBER, "yaw": [*NUMBER, 10.0], "roll": [*NUMBER, -2.0], "speed": POSITIVE,
                   "turning": without_none(NOT_NEGATIVE)}),
    (ms.patches, {"track": TRACK, "pose": ms.Pose(), "side": "right", "vertical": 1e5}, SHARED | {"side": WORD}),
    (ms.axle, {"track": TRACK, "pose": ms.Pose(), "vertical": 1e5}, SHARED | {"even": TRUTH}),
    (ms.contact_table, {"track": TRACK, "load": 1e5, "lateral": 4e-3, "yaw": 0.01}, {
        "track": SYSTEM, "load": POSITIVE, "lateral": POSITIVE, "yaw": POSITIVE, "checked": COUNT, "seed": WHOLE,
        "points": [3, None, "x", (2, 2), (4.5, 2)], "report": FUNCTION,
    }),
    (ms.creep_table, {"poisson": 0.28},
     {"poisson": POISSON, "points": [4, None, (4, 4, 4, 4, 3)], **MODEL, "checked": COUNT, "seed": WHOLE}),
    *((write, {"path": "x"}, {"table": SYSTEM}) for write in (ms.write_creep_table, ms.write_contact_table)),
    *((read, {"path": "x"}, {"path": FILE}) for read in (ms.read_creep_table, ms.read_contact_table)),
    (ms.amplitude_spread, {"amplitudes": [0.3, 0.5, 0.9]},
     {"amplitudes": ["x", NAN, None, {}, [], ["a"], [0.1, NAN], 1j], "level": ["x", NAN, 0.0, 1.0, {}, 1j],
      "draws": COUNT, "seed": WHOLE}),
    (ms.blades_from_modes, {"tuned": [1.0], "frequency": [1.0], "shapes": np.eye(2), "frequency_noise": 0.01,
                            "shape_noise": 0.01},
     {"tuned": ["x", NAN, None, []], "frequency": ["x", NAN, None, []], "shapes": ["x", NAN, None, [], [1.0]],
      "frequency_noise": NUMBER, "shape_noise": NUMBER, "find_tuned": TRUTH}),
    (ms.blades_from_gauges, {"ring": None, "frequency": [1.0], "amplitude": np.eye(2), "noise": 0.01},
     {"ring": SYSTEM, "frequency": ["x", NAN, None, []], "amplitude": ["x", NAN, None, [], [1.0]]}),
    (ms.structure, {"M": 1.0, "K": 1.0, "C": 0.1, "force": {0: 0.3}}, {
        "M": MATRIX, "K": MATRIX, "force": FORCE, "steady": FORCE, "second_force": FORCE, "name": TEXT,
        "elements": ["x", 3.0, [1.0], {}, ["x"], NAN, 2 * [ms.jenkins(1.0, 0.5, name="a")]],
        "output": ["x", NAN, 1.5, -1, [NAN], ["x"], [None], [[0]], 5, {}, -7, INF],
        "damping_ratio": ["x", NAN, INF, -0.1, 1.0, {}, [[0.1]], [], None, ["a"], [0.1, 0.2]],
    } | optional(C=MATRIX)),
    (ms.polynomial, {"stiffness": {3: 1.0}}, {
        "stiffness": ["x", NAN, None, [], {}, {3: NAN}, {3: "a"}, {"3": 1.0}, {NAN: 1.0}, {INF: 1.0}, {None: 1.0},
                      {-1: 1.0}, {10**9: 1.0}, {3: [1.0]}, {3: 1e200}, {3: 1j}, {1.5: 1.0}],
        "at": PLACE, "to": PLACE, "name": TEXT,
    }),
    (ms.jenkins, {"stiffness": 1.0, "limit": 1.0},
     {"stiffness": [*POSITIVE, [1.0], np.ones(2)], "limit": [*NOT_NEGATIVE, [1.0]], "at": PLACE, "to": PLACE,
      "name": TEXT}),
    (ms.stop, {"stiffness": 1.0, "gap": 1.0}, {
        "stiffness": [v for v in POSITIVE if v is not INF], "gap": NUMBER, "at": PLACE, "to": PLACE, "both": TRUTH,
        "restitution": ["x", NAN, -1.0, 2.0, None, []], "name": TEXT,
    }),
    (ms.friction, {"limit": 1.0}, {"limit": NOT_NEGATIVE, "at": PLACE, "to": PLACE, "name": TEXT}),
    (ms.Element, {"law": ms.jenkins(1.0, 1.0).law, "at": 0},
     {"law": SYSTEM, "at": PLACE, "to": PLACE, "along": WORD, "name": TEXT, "length": without_none(POSITIVE)}),
    (ms.Dynamics, {"rate": rate, "labels": ("x", "y"), "scale": np.ones(2)}, {
        "rate": FUNCTION, "labels": [3, None, (), "x", (1, 2), NAN, ("x", "x")], "parameter_scale": POSITIVE,
        "scale": [1.0, "x", NAN, None, [1.0], [1.0, NAN], [1.0, -1.0], [1.0, 0.0], [], {}],
        "outputs": [3, NAN, (1,), ("a",)], "units": [3, NAN, (1,), ("m",)], "bends": ["x", 3.0, NAN, np.eye(3)],
    } | optional(frequency=FUNCTION, read=FUNCTION)),
    (ms.harmonic_response, {"system": SLIDER, "frequency": [0.1]},
     {"system": SYSTEM, "frequency": FREQUENCIES, "unit": WORD, **BALANCE}),
    (ms.two_tones, {"system": TWO, "first": 0.2, "second": 0.13}, {
        "system": SYSTEM, "first": FREQUENCIES, "second": FREQUENCIES, "free": TRUTH, "unit": WORD, **BALANCE,
        "samples": [*without_none(COUNT), 19],
        "turns": [*without_none(COUNT), 10], "start": ["x", 3.0], "kept": ["x", 3.0],
    }),
    (ms.follow, {"system": SLIDER, "start": 0.1, "stop": 0.2}, {
        "system": SYSTEM, "start": POSITIVE, "stop": POSITIVE, "over": WORD, "unit": WORD, **BALANCE,
        "frequency": [*without_none(POSITIVE), 0.15],
        "settings": ["x", 3.0, [0], {3: 1}, {"low": 0.1}, {"high": 0.2}, {"direction": -1}],
    }),
    (ms.backbone, {"system": SLIDER, "low": 1e-3, "high": 1.0}, {
        "system": SYSTEM, "low": POSITIVE, "high": [*POSITIVE, 1e-4], "mode": [*WHOLE, 5], "output": [*WHOLE, 5],
        **BALANCE,
    }),
    (ms.integrate, {"system": SLIDER, "frequency": 0.24}, {
        "system": SYSTEM, "frequency": POSITIVE, "second": without_none(POSITIVE), "unit": WORD, "settle": WHOLE,
        "keep": COUNT, "samples": COUNT, "steps": without_none(COUNT), "method": WORD, "tolerance": POSITIVE,
        "file": [*without_none(FILE), ""], "report": FUNCTION,
        "start": ["x", 3, None, [], {"a": 1}, {"displacement": {-1: 1.0}}, {"velocity": {0.5: 1.0}}, {"mode": 1},
                  {"mode": 0, "amplitude": 1.0}, {"mode": 1, "amplitude": "x"}, {"displacement": [1.0, 2.0]}],
    }),
    (ms.integrate_many, {"system": SLIDER, "frequency": 0.24, "displacements": [[0.1]], "velocities": [[0.0]]}, {
        "system": SYSTEM, "frequency": POSITIVE, "unit": WORD, "settle": WHOLE, "keep": COUNT,
        "displacements": ["x", NAN, [], [[NAN]], [["a"]], [0.1], None, [[0.1, 0.2]], {}],
        "velocities": ["x", NAN, [], [[NAN]], [0.1], None, [[0.0], [0.0]], {}], "steps": without_none(COUNT),
    }),
    (ms.run_up, {"system": SLIDER, "start": 0.1, "stop": 0.2, "time": 20.0}, {
        "system": SYSTEM, "start": POSITIVE, "stop": [*POSITIVE, 0.1], "time": POSITIVE, "unit": WORD, "order": COUNT,
        "euler": ["x", 3.0, None, (1,), NAN], "samples": COUNT, "steps": without_none(COUNT), "begin": WORD,
        "file": [*without_none(FILE), ""], "report": FUNCTION,
    }),
    (ms.bifurcate, {"system": BRUSSELATOR, "start": 1.5, "stop": 1.6, "orbits": False}, {
        "system": [*SYSTEM, lambda p: None, lambda p: "x"], "start": NUMBER, "stop": [*NUMBER, 1.5],
        "x": ["x", NAN, [1.0], [NAN, 1.0], [[1.0, 1.0]], {}],
        "frequency": [*without_none(POSITIVE), 3.0], "unit": WORD, "orbits": TRUTH, "doublings": WHOLE, "starts": COUNT,
        "attractors": ["x", NAN, None, [NAN], ["a"], [5.0], [1.55]],
        "deflate": ["x", NAN, None, [NAN], ["a"], [5.0], [1.55]], "nodes": COUNT,
        "step": [*POSITIVE, 5], "points": COUNT, "report": FUNCTION,
    }),
    (ms.stability, {"body": FLUTTER}, {
        "body": [3.0, None, NAN, [], (1.0,), ([[1]], [[1]], [["a"]]), ([[NAN]], [[0.0]], [[1.0]]),
                 ([[1.0]], [[0.0]], [[1.0, 2.0]]),
                 *(([[1.0]], [[0.0]], sp.csr_matrix([[K]])) for K in (1 + 0.5j, NAN))],
        "frequency": ["x", 3.0, (1.0,), (NAN, 1.0), ("a", 1.0), (2.0, 1.0), (1.0, 1.0), [], (-1.0, NAN)],
        "growth": ["x", 3.0, (1.0,), (NAN, 1.0), None, (1.0, -1.0)], "over": [3.0, NAN, ""],
        "values": ["x", 3.0, [NAN], [], [1.0, 2.0]], "at": ["x", 3.0, {"a": 1.0}, {"a": "x"}, NAN],
        "accuracy": POSITIVE, "neutral": NOT_NEGATIVE, "certify": TRUTH, "speed": [*without_none(WHOLE), 0],
        "report": FUNCTION,
    }),
    (ms.Scatter, {"of": "frequency", "deviation": 0.01}, {
        "of": WORD, "deviation": NOT_NEGATIVE, "distribution": WORD, "values": ["x", NAN, [NAN], ["a"], 3.0, None],
        "others": ["x", 3.0, NAN, []], "arrangement": WORD, "component": TEXT, "contact": TEXT, "at": TEXT,
        "together": ["x", NAN, 2.0, None, []], "neighbours": ["x", NAN, 2.0, None, []],
    }),
    (ms.mistune, {"system": SLIDER, "scatter": ms.Scatter("frequency", 0.01), "frequency": [1.0, 2.0, 3.0]}, {
        "system": [*SYSTEM, SLIDER], "frequency": FREQUENCIES, "samples": COUNT, "until": without_none(POSITIVE),
        "rare": WHOLE, "seed": WHOLE, "stuck": TRUTH, "harmonics": COUNT, "points": without_none(COUNT),
        "workers": COUNT, "report": FUNCTION,
    }),
    (ms.prepare, {}, dict.fromkeys(("double", "compiler", "cache"), TRUTH)),
    (ms.assemble, {"case": {"body": "vane"}}, {
        "case": FILE, "folder": FILE, "normal_force": without_none(NOT_NEGATIVE), "report": FUNCTION,
    }),
    (ms.modes, {"body": {"name": "a"}}, {"body": FILE, "folder": FILE, "report": FUNCTION}),
    *((read, {"path": "x"}, {"path": FILE}) for read in (ms.load, ms.read_basis, ms.read_response, ms.read_orbits)),
]  # fmt: skip


@pytest.mark.parametrize(
    ("function", "good", "key"),
    [pytest.param(f, good, key, id=f"{f.__name__}-{key}") for f, good, kinds in CALLS for key in kinds],
)
def test_nonsense_is_refused_by_its_name(function, good, key):
    nonsense = next(kinds[key] for f, _, kinds in CALLS if f is function)
    for value in nonsense:
        with pytest.raises(UserError) as caught:
            function(**{**good, key: value})
        assert re.search(rf"\b{key}\b", str(caught.value)), (value, str(caught.value))


def test_what_may_be_of_several_kinds_says_of_which() -> None:
    """No word of TOML, and not one of the kinds alone."""
    for call, said in (
        (lambda: ms.integrate(SLIDER, 0.24, start="x"), "start: is 'x'; give 'static', 'rest', 'balance' or a dict"),
        (lambda: ms.integrate(SLIDER, 0.24, file=""), "file: must not be empty"),
        (lambda: ms.modes(5), "body: is 5; give a path, text or a dict"),
        (lambda: ms.follow(SLIDER, 0.1, 0.2, settings=3), "settings: is 3; give Settings or a dict"),
    ):
        refused(said, call)


@pytest.mark.parametrize("given", [1.0, [1.0, 2.0, 3.0], [1, 2], [1j, 2j]])
def test_a_rate_or_a_read_out_of_another_shape_or_kind_is_refused(given) -> None:
    for key in ("rate", "read"):
        made = dynamics(**{key: lambda *_: jnp.asarray(given)})
        refused(f"Dynamics: {key}: gives", ms.bifurcate, made, 1.5, 1.6, orbits=False)


def test_what_is_linear_has_no_bifurcation_and_no_normal_force() -> None:
    plain, spring = (ms.structure(1.0, 1.0, 0.1, force={0: 1.0}, elements=e) for e in ([], [ms.polynomial({3: 1.0})]))
    refused("bifurcate: system: ", ms.bifurcate, lambda p: plain, 0.5, 1.0, frequency=0.1)
    refused("over: no contact", ms.follow, spring, 1.0, 2.0, over="normal_force", frequency=0.1)


def test_numbers_of_what_a_result_does_not_have(tmp_path) -> None:
    """A read-out, point, harmonic, contact, branch or kind that is not there is no zero, no empty
    list, no IndexError."""
    found, orbit = ms.harmonic_response(SLIDER, [0.1]), ms.integrate(SLIDER, 0.1, settle=0, keep=1, samples=8)
    two, diagram = ms.two_tones(TWO, 0.2, 0.13, harmonics=2), ms.bifurcate(BRUSSELATOR, 1.5, 1.6, orbits=False)
    for call in (
        lambda: found.motion(1), lambda: found.error_estimate(0.5), lambda: found.harmonics([0]),
        lambda: found.plot(harmonic=9), lambda: orbit.plot(read_out=1), lambda: orbit.count("slips", 1),
        lambda: two.of(1, 0, 1), lambda: two.plot(point=1), lambda: two.error_estimate(1), lambda: diagram["x"],
        lambda: diagram.at("x"),
    ):  # fmt: skip
        refused((), call)


@pytest.mark.parametrize(
    "settings",
    [{"points": "a"}, {"points": NAN}, {"points": -1}, {"step_max": -1.0}, {"step": NAN}, {"step_max": "a"}],
)
def test_steps_along_a_curve_that_are_none(settings):
    refused(str(next(iter(settings))), ms.follow, SLIDER, 0.1, 0.2, settings=settings)


def test_numbers_of_numpy_are_numbers():
    force = {np.int64(0): np.float64(1.0)}
    one = ms.structure(np.float64(1.0), np.int64(1), force=force, damping_ratio=np.float32(0.125))
    found = ms.harmonic_response(one, np.float64(0.05), harmonics=np.int64(1))
    exact = 1 / abs(1 - (0.1 * np.pi) ** 2 + 0.25j * 0.1 * np.pi)
    np.testing.assert_allclose(found.amplitude, exact, rtol=1e-6)


def test_sentences_speak_in_the_unit_that_is_asked_for() -> None:
    """Reports, causes of failure and results: those of a call in rad/s hold no Hz, those of the next one do."""
    undamped = ms.structure(1.0, 1.0, force={0: 0.3})
    pushed = ms.structure(1.0, 1.0, -0.01, force={0: 0.3}, second_force={0: 0.1}, elements=[ms.polynomial({3: 0.1})])
    said: list[str] = []
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        said += ms.harmonic_response(undamped, [1.0], unit="rad/s", report=said.append).status
        said += [repr(ms.two_tones(pushed, 0.3, 0.17, harmonics=2, unit="rad/s", report=said.append))]
        rising = ms.run_up(undamped, 0.3, 0.6, 60.0, unit="rad/s", samples=32)
        said += [rising.run_up, *(str(w.message) for w in warned)]
    assert len([one for one in said if "rad/s" in one]) >= 5 and not [one for one in said if "Hz" in one]
    assert "0.0477465 Hz" in ms.run_up(undamped, 0.3 / (2 * np.pi), 0.5, 5.0, samples=32).run_up


@pytest.mark.parametrize("function", [f for f, *_ in CALLS], ids=lambda f: f.__name__)
def test_what_is_missing_is_named_after_what_is_wrong(function) -> None:
    """One sentence names all that has no default, and another what is given and wrong; both are of the function."""
    wanted = [p.name for p in inspect.signature(function).parameters.values()
              if p.default is p.empty and p.kind is not p.VAR_KEYWORD]  # fmt: skip
    if not wanted:
        return
    with pytest.raises(UserError) as caught:
        function()
    assert str(caught.value).startswith(f"{function.__name__}: ") and "missing" in str(caught.value)
    assert all(re.search(rf"\b{name}\b", str(caught.value)) for name in wanted)


def test_a_wrong_value_is_told_though_others_are_missing() -> None:
    for call, said in (
        (
            lambda: ms.ellipses(A=-1),
            ["ellipses: A: must be greater than 0", "B, force, modulus: are missing"],
        ),
        (lambda: ms.fastsim(mu=-0.3), ["'mu'", "friction"]),
        (lambda: ms.Dynamics(rate, 1.0), ["Dynamics: labels: ", "Dynamics: scale: is missing; give it"]),
        (lambda: ms.Track(radius=-1.0), ["Track: radius: must be greater than 0", "wheel, rail, wheel_at"]),
        (lambda: ms.stop(1.0, 2.0, 3.0, 4.0, False, "x", 0.0, 1.0), ["stop: ", "positional"]),
    ):
        with pytest.raises(UserError) as caught:
            call()
        assert all(one in str(caught.value) for one in said), str(caught.value)


def test_matrices_of_other_kinds_say_what_makes_them_fit() -> None:
    for call, said in (
        (
            lambda: ms.structure(sp.eye(2, format="csr"), np.eye(2)),
            "M: is a sparse matrix and must be an array, .toarray()",
        ),
        (lambda: ms.structure(np.eye(2), np.eye(2) * (1 + 0j)), "K: is complex and must be real, as its .real is"),
        (lambda: ms.structure(1.0, 1.0 + 0.1j), "K: is complex and must be real; "),
    ):
        with pytest.raises(UserError, match=re.escape(said)):
            call()


def test_a_slider_that_holds_nothing_is_no_slider() -> None:
    """Nor is one refused for a length that nobody gave: far from 1 N and 1 N/m it has one."""
    free = ms.structure(1.0, 1.0, 0.1, force={0: 1.0})
    loose = ms.structure(1.0, 1.0, 0.1, force={0: 1.0}, elements=[ms.jenkins(1.0, 0.0)])
    found = [ms.harmonic_response(one, [0.1, 0.2]) for one in (free, loose)]
    np.testing.assert_allclose(found[1].amplitude, found[0].amplitude, rtol=1e-9)
    assert found[1].converged.all()
    for stiffness, limit in ((1e-20, 1e20), (1e20, 1e-20)):
        ms.jenkins(stiffness, limit)
