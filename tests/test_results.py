"""Response files: round trip, resuming, a writer killed at random instants, damaged and foreign files."""

from __future__ import annotations

import csv
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from refusals import refused
from small import basis as small_basis

from microslip.errors import UserError
from microslip.harmonic_balance import reduced
from microslip.results import (
    Body,
    Response,
    Series,
    open_journal,
    read_journal,
    read_response,
    response_of,
    response_table,
    write_response,
)

RNG = np.random.default_rng(5)
HEAD = {
    "case": "beam",
    "mode": "aft",
    "bodies": {"blade": vars(Body("small", "0" * 64, "basis.h5", 0, 0.0, ((0, False), (0, False))))},
    "parameters": {"normal_force = 10": {"normal_force": 10.0}},
    "labels": {"monitors/tip-probe": ["u_x", "u_y", "u_z"]},
}


def point(frequency: float, status: str = "converged") -> dict:
    """A point whose every number follows from its frequency."""
    q = np.exp(1j * frequency * np.arange(12)).reshape(2, 6)
    monitors = {"monitors/tip-probe": small_basis().groups[0, 0].monitors["tip-probe"].rows @ q.T}
    return {
        "frequency": frequency, "status": status, "error": 1e-12 * frequency, "iterations": 7,
        "x": np.cos(frequency * np.arange(9)), "bodies/blade/q": q, **monitors,
    }  # fmt: skip


def sweep(asked: list[float], added: Sequence[float] = (), near: Sequence[tuple[float, float]] = ()) -> Series:
    """A series with an amplitude of three times the frequency: points asked for and added, Hz, and peaks -> the point
    beside which each was searched for."""
    peaks = dict(near)
    f = np.array(sorted({*asked, *added, *peaks}))
    arrays = {
        "frequency": f, "peak": np.array([peaks.get(x, 0.0) for x in f]), "added": np.isin(f, added).astype(int),
        "iterations": np.full(len(f), 4), "harmonics": np.ones(len(f)), "monitors/tip": np.zeros((len(f), 1, 2)),
    }  # fmt: skip
    arrays["monitors/tip"][:, 0, 1] = 3 * f
    status = tuple("converged" if x < 35 else "fold" for x in f)
    return Series("a", {}, f, status, arrays, {"monitors/tip": ("u_x",)})


@pytest.mark.parametrize("estimated", [None, 0.25, np.inf])
def test_what_is_not_known_is_null_in_the_file(tmp_path, estimated: float | None) -> None:
    """An error that is unknown, one that is not estimated, a number that a table lacks: read back as they were."""
    rows = ({"frequency_Hz": 10.0, "damping_ratio": np.nan, "doubt": ""},)
    path, settings = tmp_path / "response.h5", {"x": 1.0}
    write_response(
        path, Response("a", "aft", (sweep([10.0]),), settings=settings, resonances=rows, estimated=estimated)
    )
    found = read_response(path)
    assert found.estimated == estimated and np.isnan(found.resonances[0]["damping_ratio"])
    with h5py.File(path) as file:
        texts = [file[n][()].tobytes() for n in ("resonances", "estimated", "settings") if n in file]
    assert not any(word in text for text in texts for word in (b"NaN", b"Infinity"))


def test_the_table_has_every_point_of_every_series() -> None:
    """In order of the frequency, peaks with the amplitude that they have; cells of a series without a point there are
    empty; a peak at a point of the sweep is asked for; points of one series that differ in the tenth digit are two
    rows, one of two series that differ by rounding is one."""
    two = sweep([10.0, 20.0, 40.0], [30.0], [(20.0, 20.0), (20.00000001, 20.0)])
    table = response_table({5.0: sweep([10.0, 20.0 * (1 + 1e-15), 40.0], [], [(12.5, 10.0)]), 7.0: two})
    rows = list(csv.DictReader(table.splitlines()))
    assert [float(r["frequency_Hz"]) for r in rows] == [10.0, 12.5, 20.0, 20.00000001, 30.0, 40.0]
    assert [r["amplitude_m_FN_5_N"] for r in rows] == ["30", "37.5", "60", "", "", ""]
    assert [r["amplitude_m_FN_7_N"] for r in rows] == ["30", "", "60", "60", "90", ""]
    assert [r["converged_FN_5_N"] for r in rows] == ["1", "1", "1", "", "", "0"]
    assert [r["asked"] for r in rows] == ["1", "0", "1", "0", "0", "1"]
    assert not any(r[name] for r in rows[3:5] for name in r if name.endswith("_FN_5_N"))


def test_what_is_no_solution_has_no_numbers_of_a_motion() -> None:
    """The point at 40 Hz did not converge: its cells are empty in the table but for how it was looked for, nan in the
    data frame and in xarray, so that the largest of a column is one of a solution, and so is what
    a series says itself; `arrays` keep what there was."""
    series = sweep([10.0, 20.0, 40.0])
    last = list(csv.DictReader(response_table({5.0: series}).splitlines()))[-1]
    known = {"frequency_Hz": "40", "asked": "1", "converged_FN_5_N": "0", "iterations_FN_5_N": "4"}
    assert {name: v for name, v in last.items() if v} == {**known, "harmonics_FN_5_N": "1"}
    assert series.columns()["amplitude_m"][:2].tolist() == [30.0, 60.0]
    assert series.to_dataframe()["amplitude_m"].max() == 60.0 and series.arrays["monitors/tip"][2, 0, 1] == 120.0
    for told in (series.amplitude, series.phase, series.dissipated, series.by_slip, series.monitor("tip")[:, 0, 1]):
        assert np.isnan(told).tolist() == [False, False, True]
    known = series.to_xarray()
    assert abs(known["monitors.tip"]).max() == 60.0 and known["iterations"].values.tolist() == [4, 4, 4]


def same(a: dict, b: dict) -> None:
    assert a.keys() == b.keys()
    for name in a:
        np.testing.assert_array_equal(a[name], b[name])


# ---------------------------------------------------------------- journal


def test_points_come_back_as_they_were_kept(tmp_path):
    path = tmp_path / "response.points"
    with open_journal(path, "abc", HEAD) as journal:
        for f in (100.0, 300.0, 200.0):
            journal.keep("normal_force = 10", f, point(f))
        journal.keep("normal_force = 10", 300.0, point(300.0, "no convergence"))  # once more, the last one counts
    head, series = read_journal(path)
    assert head == {**HEAD, "inputs": "abc"} or head["inputs"] == "abc"
    assert list(series) == ["normal_force = 10"] and sorted(series["normal_force = 10"]) == [100.0, 200.0, 300.0]
    same(series["normal_force = 10"][200.0], point(200.0))
    assert series["normal_force = 10"][300.0]["status"] == "no convergence"


def test_same_inputs_continue_and_others_begin_anew(tmp_path):
    path = tmp_path / "response.points"
    with open_journal(path, "abc", HEAD) as journal:
        journal.keep("a", 1.0, point(1.0))
    with open_journal(path, "abc", HEAD) as journal:
        assert list(journal.of("a")) == [1.0]
        journal.keep("a", 2.0, point(2.0))
    with open_journal(path, "abc", HEAD) as journal:
        assert list(journal.of("a")) == [1.0, 2.0]
    with open_journal(path, "abd", HEAD) as journal:
        assert journal.of("a") == {}
    with open_journal(path, "abd", HEAD) as journal:
        journal.keep("a", 1.0, point(1.0))
    with open_journal(path, "abd", HEAD, fresh=True) as journal:
        assert journal.of("a") == {}


def test_head_grows_with_what_is_asked_for(tmp_path):
    """A later run with another series tells of it; what the earlier ones told stays."""
    path = tmp_path / "response.points"
    with open_journal(path, "abc", HEAD) as journal:
        journal.keep("normal_force = 10", 1.0, point(1.0))
    more = {"parameters": {**HEAD["parameters"], "normal_force = 20": {"normal_force": 20.0}}}
    with open_journal(path, "abc", more) as journal:
        journal.keep("normal_force = 20", 1.0, point(1.0))
        size = path.stat().st_size
    with open_journal(path, "abc", more):
        assert path.stat().st_size == size
    found = read_response(path)
    assert found.case == "beam" and found.one(normal_force=20.0).name == "normal_force = 20"


def test_coordinates_in_modes_are_read_in_modes():
    """A basis in physical interface coordinates: the same displacement from both kinds of coordinates."""
    from small import beam, table

    from microslip.modal.compute import modal_basis
    from microslip.operating.motion import displacement
    from microslip.settings.body import BodySettings

    basis = modal_basis(beam(), BodySettings.model_validate(table(reduction="craig-bampton")))
    group = basis.groups[0, 0]
    assert group.to_diagonal is not None
    p = RNG.normal(size=(2, group.to_diagonal.shape[1])) + 0j
    u = []
    for q, modes in ((p, True), (p @ group.to_diagonal.T, False)):
        body = Body("small", "", "", 0, 0.0, ((0, False), (0, False)), modes)
        row = {"frequency": 5.0, "status": "converged", "bodies/blade/q": q}
        found = response_of({"case": "c", "bodies": {"blade": vars(body)}}, {"a": {5.0: row}})
        u.append(displacement(found.motion(found.series[0], basis), 9))
    np.testing.assert_allclose(u[0], u[1], rtol=1e-9)


@pytest.mark.parametrize("cut", [1, 3, 17, 21, 200, 500])
def test_a_torn_record_is_left_out_and_cut_off(tmp_path, cut):
    path = tmp_path / "response.points"
    with open_journal(path, "abc", HEAD) as journal:
        journal.keep("a", 1.0, point(1.0))
        whole = path.stat().st_size
        journal.keep("a", 2.0, point(2.0))
    data = path.read_bytes()
    path.write_bytes(data[: whole + cut])
    assert list(read_journal(path)[1]["a"]) == [1.0]
    with open_journal(path, "abc", HEAD) as journal:
        assert path.stat().st_size == whole
        journal.keep("a", 2.0, point(2.0))
    assert path.read_bytes() == data


def test_flipped_bytes_never_make_wrong_points(tmp_path):
    """After any one flipped byte every point that is still read is right, or the file is refused in one sentence."""
    path = tmp_path / "response.points"
    with open_journal(path, "abc", HEAD) as journal:
        for f in (1.0, 2.0, 3.0):
            journal.keep("a", f, point(f))
    data = bytearray(path.read_bytes())
    for i in range(0, len(data), 11):
        flipped = data.copy()
        flipped[i] ^= 1 << (i % 8)
        path.write_bytes(flipped)
        try:
            found = read_journal(path)[1].get("a", {})
        except UserError:
            continue
        for f, p in found.items():
            same(p, point(f))


_WRITER = """
import sys
sys.path[:0] = {path!r}
from pathlib import Path
import numpy as np
from microslip.results import open_journal, response_of, write_response
folder = Path({folder!r})
with open_journal(folder / "response.points", "abc", {{"case": "a"}}) as journal:
    begun = max(journal.of("a"), default=0.0)
    print(len(journal.of("a")), flush=True)
    for f in range(int(begun) + 1, 100000):
        journal.keep("a", float(f), {{"status": "converged", "x": np.cos(f * np.arange(900))}})
        if f % 40 == 0:
            write_response(folder / "response.h5", response_of(journal.head, journal.series))
"""


@pytest.mark.slow
def test_a_writer_killed_at_random_instants_leaves_readable_files(tmp_path):
    """SIGKILL four times at random, later on a machine that keeps no point until then: the points are 1, 2, 3, ...
    without a hole, the HDF5 file is whole or absent."""
    rng, reached, longest = random.Random(8), 0, 0.12
    code = _WRITER.format(folder=str(tmp_path), path=sys.path)
    for kill in range(40):
        if kill >= 4 and reached > 7:
            break
        process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
        assert process.stdout is not None
        assert int(process.stdout.readline()) == reached  # nothing that was kept is lost, nothing is computed twice
        time.sleep(rng.uniform(0.0, longest))
        longest *= 1.0 if kill < 4 else 1.2
        process.send_signal(signal.SIGKILL)
        process.wait()
        process.stdout.close()
        found = read_journal(tmp_path / "response.points")[1].get("a", {})
        assert sorted(found) == [float(f) for f in range(1, len(found) + 1)] and len(found) >= reached
        for f in [f for f in found if f > reached][-3:]:
            np.testing.assert_array_equal(found[f]["x"], np.cos(f * np.arange(900)))
        reached = len(found)
        if (tmp_path / "response.h5").exists():
            whole = read_response(tmp_path / "response.h5")
            assert len(whole.series[0].key) % 40 == 0 and len(whole.series[0].key) <= reached
    assert reached > 7


# ---------------------------------------------------------------- HDF5


def response(*frequencies: float) -> Response:
    head = {**HEAD, "inputs": "abc", "finished": True, "messages": ["beware"], "resonances": [{"frequency_Hz": 2.0}]}
    return response_of(head, {"normal_force = 10": {f: point(f) for f in frequencies}})


def test_response_round_trip(tmp_path):
    written = response(1.0, 2.0, 3.0)
    write_response(tmp_path / "response.h5", written)
    found = read_response(tmp_path / "response.h5")
    one = found.one(normal_force=10.0)
    for name, value in written.series[0].arrays.items():
        np.testing.assert_array_equal(one.arrays[name], value)
    assert one.status == ("converged",) * 3 and one.converged.all() and list(one.key) == [1.0, 2.0, 3.0]
    for name in ("case", "mode", "inputs", "bodies", "labels", "resonances", "messages", "finished"):
        assert getattr(found, name) == getattr(written, name), name
    with h5py.File(tmp_path / "response.h5") as file:
        assert file["series_0000/bodies/blade/q"].attrs["unit"] == "m kg^1/2"
        assert file["series_0000/frequency"].attrs["unit"] == "Hz"


def test_readouts_of_a_file_are_those_that_were_asked_for_in_their_order_and_units(tmp_path):
    """A monitor may be called like a quantity, and the first one need not be the first in the alphabet."""
    rows = {"monitors/zeta": ["u_z", "u_x"], "gauges/limit": ["strain"], "monitors/force": ["u_x"]}
    sizes = {name: (1 + i) * np.ones((len(of), 2)) for i, (name, of) in enumerate(rows.items())}
    written = response_of({**HEAD, "labels": rows}, {"one": {f: point(f) | sizes for f in (1.0, 2.0)}})
    write_response(tmp_path / "response.h5", written)
    (one,) = read_response(tmp_path / "response.h5").series
    assert one.readouts[:4] == written.series[0].readouts[3:] == ("zeta u_z", "zeta u_x", "limit", "force")
    assert [one.harmonics(n)[0, 1].real for n in one.readouts[:4]] == [1, 1, 2, 3]
    seen = one.to_xarray()
    assert [seen[n].units for n in ("monitors.zeta", "gauges.limit", "monitors.force")] == ["m", "1", "m"]
    with h5py.File(tmp_path / "response.h5") as file:
        assert file["series_0000/monitors/force"].attrs["unit"] == "m"
    assert [one.plot(readout=i).get_ylabel() for i in (1, 2)] == ["amplitude in m", "amplitude in m/m"]


def test_what_reads_nothing_but_rounding_reads_nothing():
    """Of two coordinates that move alike the difference is no motion; of one that hardly moves its own is."""
    output = np.array([[1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 0.0, 3.0]])
    part = SimpleNamespace(output=output, output_residual=np.zeros((3, 0)), output_given=np.zeros(3))
    q = np.array([[1.0, 1.0 - 2e-16, 1e-20], [1.0, 1.0 - 1e-6, 0.0]], dtype=complex)
    found = reduced.read([part, part], q, np.zeros((2, 0)))
    np.testing.assert_allclose(found, [[0, 1e-6], [0, 1e-6], [3e-20, 0]], rtol=1e-9, atol=0)
    assert np.isnan(reduced.read([part], np.full((1, 3), np.nan), np.zeros((1, 0)))).all()
    labels = {"gauges/root": ["strain"], "monitors/tip-probe": ["u_x", "u_y", "u_z"]}
    still = point(1.0) | {"gauges/root": np.zeros((1, 2), complex)}
    (one,) = response_of({**HEAD, "labels": labels}, {"one": {1.0: {n: still[n] for n in [*labels, *still]}}}).series
    assert "root does not move" in repr(one)


def test_same_response_same_bytes(tmp_path):
    for name in ("a.h5", "b.h5"):
        write_response(tmp_path / name, response(1.0, 2.0))
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


def test_motion_of_a_response_reads_what_the_monitor_kept(tmp_path):
    from microslip.operating.motion import read_out

    found = response(1.0, 2.0)
    motion = found.motion(found.series[0], small_basis())
    told = found.series[0].monitor("tip-probe")
    np.testing.assert_allclose(read_out(motion, "tip-probe"), told.transpose(0, 2, 1), rtol=1e-12)
    refused("this is 'other'", found.motion, found.series[0], replace(small_basis(), name="other"))
    refused("another state", found.motion, found.series[0], small_basis(), sha256="1" * 64)
    refused("has tip-probe", found.series[0].monitor, "nose")
    refused("0 series have normal_force = 11", found.one, normal_force=11.0)


def test_points_with_more_harmonics_stand_beside_points_with_fewer():
    head = {**HEAD, "inputs": "abc"}
    more = point(2.0) | {"bodies/blade/q": np.ones((4, 6), dtype=complex)}
    q = response_of(head, {"a": {1.0: point(1.0), 2.0: more}}).series[0].arrays["bodies/blade/q"]
    assert q.shape == (2, 4, 6) and not q[0, 2:].any() and q[1, 3, 5] == 1


def test_unfinished_response_is_read_from_its_journal(tmp_path):
    with open_journal(tmp_path / "response.points", "abc", HEAD) as journal:
        journal.keep("normal_force = 10", 1.0, point(1.0))
        found = read_response(tmp_path / "response.points")
    assert not found.finished and found.series[0].parameters == {"normal_force": 10.0}


@pytest.mark.usefixtures("untried")
def test_damaged_and_foreign_files_get_one_sentence(tmp_path):
    path = tmp_path / "response.h5"
    refused("no such response", read_response, path)
    path.write_bytes(b"nothing of the kind" * 99)
    refused("no HDF5 file", read_response, path)
    refused("is text, not an HDF5 file", write_response, path, response(1.0))
    path.unlink()
    write_response(path, response(1.0))
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 4
    path.write_bytes(data)
    refused("is damaged", read_response, path)
    with h5py.File(path, "w") as file:
        file.attrs["format"] = "microslip-modal-basis"
    refused("is 'microslip-modal-basis'", read_response, path)


@pytest.mark.slow
def test_incomplete_and_newer_files_get_one_sentence(tmp_path):
    path = tmp_path / "response.h5"
    write_response(path, response(1.0))
    with h5py.File(path, "r+") as file:
        file.attrs["format_version"] = "7.0"
    refused("7.0", read_response, path)
    write_response(path, response(1.0))
    with h5py.File(path, "r+") as file:
        del file["series_0000/key"]
    refused("incomplete", read_response, path)
    write_response(path, response(1.0, 2.0))
    with h5py.File(path, "r+") as file:
        del file["series_0000/frequency"]
        file["series_0000/frequency"] = np.ones(5)
    refused("different lengths", read_response, path)


def test_empty_series_and_no_series(tmp_path):
    empty = Response("none", "aft", (Series("a", {}, np.zeros(0), (), {}),))
    write_response(tmp_path / "r.h5", empty)
    assert read_response(tmp_path / "r.h5").series[0].status == ()
    write_response(tmp_path / "r.h5", Response("none", "aft", ()))
    assert read_response(tmp_path / "r.h5").series == ()


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_folder_without_rights(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(UserError, match="cannot be written"), open_journal(tmp_path / "p", "abc", HEAD):
        pass
