"""Test angles between signatures for lines and planes of known angles."""

import numpy as np
import pytest

from forcefit.validation.diagnosis.separability import compare_signatures


def columns(*vectors):
    return 10 * np.array(vectors, dtype=float).T


def test_cosine_of_two_lines_equals_that_of_their_angle():
    """The angle between the lines is 60 degrees."""
    found = compare_signatures({
        "a": columns([1, 0, 0]), "b": columns([0.5, np.sqrt(0.75), 0])
    })  # fmt: skip
    np.testing.assert_allclose(found.cosine, [[1, 0.5], [0.5, 1]], atol=1e-14)
    np.testing.assert_allclose(found.shared, [[1, 0.5], [0.5, 1]], atol=1e-14)
    np.testing.assert_allclose(found.strength, [10, 10])
    assert found.classes() == found.imitated() == found.overlapping() == []


def test_effect_in_the_span_of_another_effect_is_imitated():
    """Two planes with a common line overlap."""
    found = compare_signatures({
        "plane": columns([1, 0, 0], [0, 1, 0]),
        "other": columns([1, 0, 0], [0, 0, 1]),
        "line": columns([1, 1, 0]),
    })  # fmt: skip
    assert found.cosine[0, 1] == pytest.approx(1)
    assert found.shared[0, 1] == pytest.approx(np.sqrt(0.5))
    assert found.shared[2, 0] == pytest.approx(1)
    assert found.imitated() == [("line", "plane")]
    assert found.overlapping() == [("plane", "other")]
    assert found.classes() == []


def test_effects_with_equal_spans_form_a_class(rng):
    A = rng.normal(size=(50, 3))
    found = compare_signatures({
        "a": A, "b": A @ rng.normal(size=(3, 3)), "c": rng.normal(size=(50, 3))
    })  # fmt: skip
    assert found.classes() == [("a", "b")]
    np.testing.assert_array_equal(found.rank, [3, 3, 3])


def test_nuisance_columns_are_projected_out(rng):
    """Two effects become orthogonal, and a third effect becomes zero."""
    out = rng.normal(size=(40, 2))
    Q, _ = np.linalg.qr(np.column_stack([out, rng.normal(size=(40, 2))]))
    found = compare_signatures(
        {
            "a": 30 * Q[:, [2]] + 400 * Q[:, [0]],
            "b": 30 * Q[:, [3]] + 400 * Q[:, [0]],
            "gone": 500 * out,
        },
        out,
    )
    assert found.cosine[0, 1] == pytest.approx(0, abs=1e-12)
    np.testing.assert_allclose(found.left[:2], 30 / np.hypot(30, 400))
    assert found.left[2] < 1e-12
    np.testing.assert_array_equal(found.rank, [1, 1, 0])
    np.testing.assert_array_equal(found.visible, [True, True, False])


@pytest.mark.parametrize("units", [1e-9, 1.0])
def test_nuisance_columns_are_projected_out_at_any_scale(units, rng):
    """One of two orthogonal nuisance columns is 200 times larger than the other."""
    Q, _ = np.linalg.qr(rng.normal(size=(40, 3)))
    out = units * Q[:, :2] * [1e4, 50.0]
    found = compare_signatures({"a": Q @ [[3.0], [4.0], [12.0]]}, out)
    assert found.left == pytest.approx(12 / 13)
    assert compare_signatures({"a": Q[:, :1]}, out[:, :0]).left == pytest.approx(1.0)


def test_equivalence_does_not_depend_on_the_size_of_an_effect(rng):
    """An effect with a norm of two sigma is invisible."""
    line = rng.normal(size=(30, 1))
    line /= np.linalg.norm(line)
    found = compare_signatures({"a": 2 * line, "b": 50 * line, "none": 1e-5 * line})
    np.testing.assert_array_equal(found.visible, [False, True, False])
    np.testing.assert_array_equal(found.traced, [True, True, False])
    np.testing.assert_allclose(found.shows_at, [1.5, 0.06, np.inf])
    assert found.classes() == [("a", "b")]


def test_rank_does_not_depend_on_the_scale_of_unknowns(rng):
    """Two columns of 1e4 and 100 sigma are orthogonal, and the third is their sum."""
    A = np.eye(3)[:, :2] * [1e4, 100.0]
    found = compare_signatures({"a": np.column_stack([A, A.sum(axis=1)])})
    assert (found.rank[0], found.unknowns[0]) == (2, 3)
    assert found.cosine.tolist() == found.shared.tolist() == [[1.0]]
