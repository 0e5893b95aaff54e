"""Kernels of a GPU, its threads in turns on the processor, against the lanes."""

import ctypes
import glob
import importlib.util
from pathlib import Path

import numpy as np
import pytest

from assembly.kinematics.posture import home_posture
from assembly.linear import device
from assembly.linear.assemblies import COMPILED
from assembly.linear.device import SOURCE, Device, room_of
from assembly.linear.energy import minimise_energies
from assembly.linear.robot_structure import structure_of
from assembly.linear.zone import zone_margins
from assembly.robots import BUILT_IN
from forcefit.native.libraries import address, by_numba, load_library
from tests.robots_for_tests import NUMBERS, irsbot2_with, random_robot, stack

needs_compiler = pytest.mark.skipif(
    load_library(SOURCE) is None, reason="no C++ compiler"
)


@pytest.fixture
def launched(monkeypatch):
    """A device that is simulated, for any number of points; the kernels launched."""
    names = []

    def launch(name, room, records):
        names.append(name)
        getattr(load_library(SOURCE), name)(
            *map(ctypes.c_void_p, records), ctypes.c_int64(7)
        )

    simulated = Device(
        put=np.array, get=np.asarray, address=address, launch=launch,
        free_bytes=lambda: 100_000, failures=(OSError,),
    )  # fmt: skip
    monkeypatch.setattr(device, "LEAST", 1)
    monkeypatch.setattr(device, "cuda_device", lambda: simulated)
    return names


def without_device(monkeypatch):
    """From here on the processor computes."""
    monkeypatch.setattr(device, "cuda_device", lambda: None)


@needs_compiler
@pytest.mark.parametrize("kappa", [0.0, 0.1, 0.5, 1.0])
def test_the_papers_robot_has_the_lanes_energies(grid, kappa, launched, monkeypatch):
    """All points certified by themselves; each energy above the other's bound."""
    robot, postures = grid
    T, mismatch = stack(postures)
    given = robot, T, kappa * robot.errors, mismatch
    threads = minimise_energies(*given)
    # in as many launches as the memory asks for
    assert (len(launched) > 5) == (kappa > 0.0)
    without_device(monkeypatch)
    lanes = minimise_energies(*given)
    assert threads.certified.all()
    assert threads.fallbacks() == {}
    rounding = 1e-12 * lanes.energy_without_clearance + 1e-30
    assert np.all(threads.energy >= lanes.bound - rounding)
    assert np.all(lanes.energy >= threads.bound - rounding)
    assert threads.platform_screw == pytest.approx(lanes.platform_screw, abs=1e-6)


@needs_compiler
@pytest.mark.parametrize("compliant", ["rigid", "free"])
def test_the_papers_robot_has_the_lanes_margins(grid, compliant, launched, monkeypatch):
    robot, postures = grid
    T, mismatch = stack(postures)
    threads = zone_margins(robot, T, compliant, mismatch)
    assert set(launched) == {"all_margins"}
    without_device(monkeypatch)
    lanes = zone_margins(robot, T, compliant, mismatch)
    assert np.array_equal(np.isnan(threads.margin), np.isnan(lanes.margin))
    assert threads.margin == pytest.approx(lanes.margin, rel=1e-8)
    assert np.all(threads.margin >= lanes.bound * (1 - 1e-12))
    assert np.all(lanes.margin >= threads.bound * (1 - 1e-12))


@needs_compiler
@pytest.mark.parametrize("name", sorted(BUILT_IN))
def test_built_in_robots_with_errors_of_their_own(name, rng, launched, monkeypatch):
    home = home_posture(BUILT_IN[name]())
    T = np.broadcast_to(home.transforms, (40, *home.transforms.shape))
    errors = 1e-4 * rng.normal(size=(40, len(home.robot.frames), 6))
    if name == "irsbot2":  # its proximal loops are rigid and perfect
        errors[:, ~np.any(irsbot2_with(NUMBERS["cases"][0]).errors, axis=1)] = 0.0
    given = home.robot, T, errors, home.mismatch
    threads = minimise_energies(*given)
    assert set(launched) == {"assemble_all"}
    without_device(monkeypatch)
    lanes = minimise_energies(*given)
    assert threads.certified.all()
    allowed = 2e-8 * lanes.energy + 2e-12 * lanes.energy_without_clearance + 1e-30
    assert np.all(np.abs(threads.energy - lanes.energy) <= allowed)


@needs_compiler
def test_random_robots_go_to_the_same_fallbacks(launched, monkeypatch):
    solved = 0
    for seed in range(40):
        rng = np.random.default_rng([seed, 17])
        robot = random_robot(rng, legs=1 + seed % 3, joints=1 + seed // 3 % 3)
        home = home_posture(robot)
        T = np.repeat(home.transforms[None], 3, axis=0)
        errors = np.array([robot.errors, 0.3 * robot.errors, -robot.errors])
        given = robot, T, errors, home.mismatch
        monkeypatch.setattr(device, "LEAST", 1)
        threads = minimise_energies(*given)
        monkeypatch.setattr(device, "LEAST", 4)
        lanes = minimise_energies(*given)
        assert np.array_equal(threads.outcome >= COMPILED, lanes.outcome >= COMPILED)
        some = lanes.outcome < COMPILED
        allowed = 2e-8 * lanes.energy + 2e-12 * lanes.energy_without_clearance + 1e-30
        assert np.all(np.abs(threads.energy - lanes.energy)[some] <= allowed[some])
        solved += np.sum(some)
    assert solved
    assert launched


def test_a_device_that_fails_leaves_it_to_the_processor(grid, launched, monkeypatch):
    """With a warning that says why."""
    robot, postures = grid
    T, mismatch = stack(postures[:3])

    def fails(*given):
        raise OSError("out of memory")

    simulated = device.cuda_device()._replace(launch=fails)
    monkeypatch.setattr(device, "cuda_device", lambda: simulated)
    with pytest.warns(RuntimeWarning, match="the processor does: out of memory"):
        energies = minimise_energies(robot, T, None, mismatch)
    assert energies.certified.all()


def test_who_asks_for_numba_gets_no_device(grid, launched):
    robot, postures = grid
    T, mismatch = stack(postures[:3])
    with by_numba():
        assert minimise_energies(robot, T, None, mismatch).certified.all()
    assert not launched


def test_few_points_stay_on_the_processor(grid, launched, monkeypatch):
    robot, postures = grid
    T, mismatch = stack(postures[:3])
    monkeypatch.setattr(device, "LEAST", 4)
    minimise_energies(robot, T, None, mismatch)
    assert not launched


def test_a_larger_robot_has_a_larger_room():
    """In steps, within what a thread may have: half a megabyte with all else."""
    rooms = {n: room_of(structure_of(BUILT_IN[n]())[1]) for n in sorted(BUILT_IN)}
    assert rooms["five_bar"] < rooms["hexapod"] < rooms["orthoglide"]
    assert all(room % 32_768 == 0 for room in rooms.values())
    assert max(rooms.values()) < 500_000


@pytest.mark.slow
def test_the_kernels_compile_for_a_gpu():
    """NVIDIA's own compiler takes the source, which needs no device."""
    spec = importlib.util.find_spec("nvidia.cuda_nvrtc")
    if spec is None:
        pytest.skip("no nvidia-cuda-nvrtc-cu12")
    (folder,) = spec.submodule_search_locations
    compiler = ctypes.CDLL(glob.glob(f"{folder}/lib/libnvrtc.so*")[0])
    source = Path(device.__file__).with_name("device.cpp")
    options = [
        "--gpu-architecture=compute_90", "-std=c++17", f"-I{source.parent}",
        "--device-as-default-execution-space", "-DROOM=131072",
    ]  # fmt: skip
    program, size = ctypes.c_void_p(), ctypes.c_size_t()
    text, name = source.read_bytes(), str(source).encode()
    handle = ctypes.byref(program)
    assert compiler.nvrtcCreateProgram(handle, text, name, 0, None, None) == 0
    given = (ctypes.c_char_p * len(options))(*map(str.encode, options))
    result = compiler.nvrtcCompileProgram(program, len(options), given)
    compiler.nvrtcGetProgramLogSize(program, ctypes.byref(size))
    log = ctypes.create_string_buffer(size.value)
    compiler.nvrtcGetProgramLog(program, log)
    assert result == 0, log.value.decode()
    compiler.nvrtcGetPTXSize(program, ctypes.byref(size))
    assembler = ctypes.create_string_buffer(size.value)
    compiler.nvrtcGetPTX(program, assembler)
    for kernel in (b".entry assemble_all(", b".entry all_margins("):
        assert kernel in assembler.value
    compiler.nvrtcDestroyProgram(handle)
