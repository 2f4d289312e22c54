"""Intervals as a reader meets them: in text, in tables, in their files and in figures."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from campaign.estimate import Estimate, Origin, Systematic
from campaign.reason import Reason
from campaign.report.content.tables import REASONS, remarks, show, table_csv
from campaign.report.drawing import curves, figures
from campaign.result import Axis, Cell, Column, Curve, Figure, Panel, Table
from campaign.text import interval

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@pytest.mark.parametrize(
    ("value", "low", "high", "text"),
    [
        (3.87, 3.75, 3.99, "3.87 ± 0.12"),
        (3.8712, 3.8612, 3.8812, "3.871 ± 0.010"),
        (-3.87, -3.99, -3.75, "−3.87 ± 0.12"),
        (0.0, -0.5, 0.5, "0.00 ± 0.50"),
        (123.0, 111.0, 135.0, "123 ± 12"),
        (12345.0, 12000.0, 12690.0, "12340 ± 340"),  # 345 is 340, half to even
        (400635.0, 276141.0, 525129.0, "400000 ± 120000"),
        (-400635.0, -500235.0, -301035.0, "−400000 ± 100000"),  # 99600 has two as 100000
        (400635.0, 276141.0, 649629.0, "400000 (280000 to 650000)"),
        (0.3, -99.3, 99.9, "0 ± 100"),
        (-0.3, -99.9, 99.3, "0 ± 100"),  # no minus where nothing is left of the number
        (5.0, 4.9004, 5.0996, "5.00 ± 0.10"),  # 0.0996 has two digits as 0.10
        (3.87, 3.8, 4.1, "3.87 (3.80 to 4.10)"),
        (-3.87, -4.1, -3.8, "−3.87 (−4.10 to −3.80)"),
        (2.0, 2.0, 3.0, "2.00 (2.00 to 3.00)"),
        (2.0, 1.5, None, "2 (≥ 1.5)"),
        (2.0, None, 2.5, "2 (≤ 2.5)"),
        (2.0, None, None, "2"),
        (2.0, -math.inf, math.inf, "2"),
        (math.nan, 1.0, 2.0, "–"),
        (None, None, None, "–"),
        (7.0, 7.0, 7.0, "7 ± 0"),
        (1.0, 1.0 - 1e-15, 1.0 + 1e-15, "1 ± 0"),  # rounding errors are no interval
        (1.4804747, 1.4804747 - 2e-10, 1.4804747 + 2e-10, "1.4804747 ± 2.0 × 10⁻¹⁰"),
        (1.5e-7, 1.4e-7, 1.6e-7, "(1.50 ± 0.10) × 10⁻⁷"),
        (4.0063e9, 3.8863e9, 4.1263e9, "(4.01 ± 0.12) × 10⁹"),
        (5.94806e-4, 5.94761e-4, 5.94851e-4, "(5.94806 ± 0.00045) × 10⁻⁴"),
        (1.116842e-5, 1.116790e-5, 1.116894e-5, "(1.116842 ± 0.000052) × 10⁻⁵"),
        (1.5e-7, 1.4e-7, 1.9e-7, "1.50 (1.40 to 1.90) × 10⁻⁷"),
        (0.0, -2e-7, 2e-7, "(0.0 ± 2.0) × 10⁻⁷"),
    ],
)
def test_a_number_is_shown_with_its_interval(
    value: float | None, low: float | None, high: float | None, text: str
) -> None:
    assert interval(value, low, high) == text


def test_what_is_shown_holds_what_was_found() -> None:
    """Ends of 2 000 random intervals are shown within 6 % of a half-width."""
    draw = np.random.default_rng(911)
    for _ in range(2000):
        half = 10.0 ** draw.uniform(-4, 4)
        value = float(draw.normal() * half * 10.0 ** draw.uniform(-1, 4))
        low, high = value - half * draw.uniform(0.5, 1), value + half * draw.uniform(0.5, 1)
        told = interval(value, low, high).replace("−", "-")
        digits, _, power = told.partition(" × 10")
        largest = max(abs(value), 0.5 * (high - low))
        assert not power or not 1e-2 <= largest < 1e6
        if "×" in digits or "to" not in digits:
            continue
        unit = 10.0 ** int(power.translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")) or 0)
        numbers = [unit * float(part) for part in re.findall(r"-?\d+(?:\.\d+)?", digits)]
        wide = 0.5 * (high - low)
        assert numbers[1] == pytest.approx(low, abs=0.06 * wide)
        assert numbers[2] == pytest.approx(high, abs=0.06 * wide)


# Tables


def estimate(value: float = 1.0, half: float | None = 0.1, **more: object) -> Estimate:
    low, high = (None, None) if half is None else (value - half, value + half)
    return replace(Estimate("x", value, "N m", low, high, 0.95), **more)


def table(columns: dict[str, list[Cell]], **how: dict[str, object]) -> Table:
    length = max(map(len, columns.values()))
    rows = tuple({name: cells[k] for name, cells in columns.items()} for k in range(length))
    described = tuple(
        Column(name, name.upper(), "N m", "mN m", **how.get(name, {})) for name in columns
    )
    return Table("key", "Title", described, rows)


def test_digits_that_no_reader_needs_are_left_to_the_file() -> None:
    """A simulation without noise tells nine digits, of which five are shown."""
    cells: list[Cell] = [estimate(1.4852135, 1e-6), estimate(1.4879, 1e-4), estimate(2.0, 0.0)]
    shown = show(table({"a": cells}))
    assert [row[0].text for row in shown.rows] == ["1485.2", "1487.90 ± 0.10", "2000 ± 0"]
    (remark,) = shown.notes
    assert "narrower than the last digit; the CSV file has it" in remark
    assert "\n1485.2135,1485.2125," in table_csv(table({"a": cells}))
    assert not show(table({"a": cells[1:]})).notes


def test_rounding_errors_of_estimates_are_nothing() -> None:
    """The width of a loop that a static model does not have, beside the one of another model."""
    widths = (0.15, -8.9e-16, 1.4e-16)
    cells: list[Cell] = [estimate(each, None, reason=Reason("test", "no noise")) for each in widths]
    assert [row[0].text for row in show(table({"a": cells})).rows] == ["150", "0", "0"]


ALONE = estimate(half=None, reason=Reason("test", "a single trial"))
WIDE = estimate(
    half=3.0, origin=Origin.NOT_DETERMINED, reason=Reason("test", "its interval is too wide")
)
LOST = Estimate.without_interval("x", math.nan, "N m", Reason("test", "it never slid"))
GIVEN = estimate(half=None, origin=Origin.GIVEN, reason=Reason("test", "it was set"))
BOUND = estimate(half=None, kind="at least")


@pytest.mark.parametrize(
    ("columns", "how", "said"),
    [
        ({"a": [estimate()]}, {}, []),
        ({"a": [BOUND]}, {}, []),
        ({"a": ["text", None]}, {}, []),
        ({"a": [1.0]}, {"a": {"exact": True}}, []),
        ({"a": [True]}, {"a": {"reason": "never said of truths"}}, []),
        ({"a": [1.0], "b": [estimate()]}, {"a": {"reason": "of ranks"}}, ["A (of ranks)."]),
        (
            {"a": [ALONE, estimate()], "b": [ALONE, ALONE]},
            {},
            ["B, A in 1 of 2 rows (a single trial)."],
        ),
        ({"a": [ALONE], "b": [ALONE], "c": [estimate()]}, {}, ["A, B (a single trial)."]),
        ({"a": [ALONE], "b": [ALONE]}, {}, ["all numbers (a single trial)."]),
        ({"a": [ALONE], "b": [3]}, {"b": {"exact": True}}, ["A (a single trial)."]),
        # A row that has a name is called by it, of one column with the column's.
        (
            {"n": ["Ts", "Tc"], "a": [ALONE, estimate()], "b": [ALONE, estimate()]},
            {},
            ["Ts (a single trial)."],
        ),
        (
            {"n": ["Ts", "Tc"], "a": [ALONE, estimate()], "b": [estimate(), estimate()]},
            {},
            ["A of Ts (a single trial)."],
        ),
        (
            {"n": ["Ts", "Ts"], "a": [ALONE, estimate()], "b": [ALONE, estimate()]},
            {},
            ["A, B in 1 of 2 rows (a single trial)."],
        ),
        ({"a": [GIVEN, estimate()]}, {}, []),  # its cell says so
        # No reader of the page sees that column.
        ({"a": [1.0]}, {"a": {"reason": "a standard error", "file_only": True}}, []),
    ],
)
def test_each_reason_for_no_interval_is_said_once(
    columns: dict[str, list[Cell]], how: dict[str, dict[str, object]], said: list[str]
) -> None:
    assert list(remarks(table(columns, **how))) == [f"Without an interval: {s}" for s in said]


def test_what_is_not_determined_is_said_apart() -> None:
    found = remarks(table({"a": [WIDE, ALONE], "b": [LOST, estimate()]}))
    assert list(found) == [
        "Without an interval: A in 1 of 2 rows (a single trial).",
        (
            "Not determined: A in 1 of 2 rows (its interval is too wide); "
            "B in 1 of 2 rows (it never slid)."
        ),
    ]


def test_systematic_parts_that_nobody_has_sized_are_named() -> None:
    """Of what has an interval: where there is none, none can lack them."""
    loose = estimate(systematic=(Systematic("inertia"), Systematic("torque constant", 0.1)))
    bare = replace(ALONE, systematic=(Systematic("inertia"),))
    found = remarks(table({"a": [loose, loose], "b": [loose, bare]}))
    assert list(found) == [
        "Without an interval: B in 1 of 2 rows (a single trial).",
        "Not included in the intervals (size unknown): inertia.",
    ]


def test_many_reasons_are_not_all_said() -> None:
    cells: list[Cell] = [
        estimate(half=None, reason=Reason("test", f"{n} samples")) for n in range(20)
    ]
    (said,) = remarks(table({"a": cells}))
    assert said.count("samples") == REASONS - 1
    assert said.endswith(f"and others, for {20 - REASONS + 1} more reasons.")


def test_cells_have_interval_bound_and_origin_in_display_units() -> None:
    assumed = estimate(
        2.0, None, origin=Origin.ASSUMED, reason=Reason("test", "a damping ratio of one")
    )
    shown = show(table({"a": [estimate(0.0102, 0.0003), BOUND, WIDE, LOST, assumed, 1.0]}))
    assert [row[0].text for row in shown.rows] == [
        "10.20 ± 0.30",
        "≥ 1000",
        "1000 ± 3000 (not determined)",
        "–",
        "2000 (assumed)",
        "1000",
    ]
    assert all(row[0].number for row in shown.rows)


def test_the_file_has_the_ends_behind_its_old_columns() -> None:
    """With the systematic part: 0.1 and 1.959964 times 0.2 in squares is 0.404547."""
    shifted = estimate(1.0, 0.1, systematic=(Systematic("inertia", 0.2),))
    text = table_csv(table({"a": [shifted, ALONE], "b": [1.0, 2.0]}))
    head, first, second = text.splitlines()
    assert head == "a_mN_m,b_mN_m,a_mN_m_low,a_mN_m_high"
    numbers = [float(cell) for cell in first.split(",")]
    assert numbers == pytest.approx([1000.0, 1000.0, 595.453, 1404.547], abs=0.01)
    assert second == "1000.0,2000.0,,"


def test_numbers_of_a_contradicted_model_are_flagged_on_the_page_and_in_the_file() -> None:
    wrong = estimate(
        1.0, 0.1, origin=Origin.CONTRADICTED, reason=Reason("test", "the exponent is not 2")
    )
    held = table({"a": [wrong, ALONE], "b": [1.0, 2.0]})
    assert show(held).rows[0][0].text.endswith("†")
    assert any("†" in text and "the exponent is not 2" in text for text in remarks(held))
    head, first, second = table_csv(held).splitlines()
    assert head == "a_mN_m,b_mN_m,a_mN_m_low,a_mN_m_high,a_mN_m_origin"
    assert first.endswith(",model contradicted")
    assert second.endswith(",measured")


# Figures


def drawn(curve: Curve, monkeypatch: pytest.MonkeyPatch, scale: str = "linear") -> Axes:
    """The axes of a panel with one curve, in mN m."""
    found: list[Axes] = []
    original: Callable[..., object] = figures._draw_panel

    def keep(ax: Axes, *rest: object) -> object:
        found.append(ax)
        return original(ax, *rest)

    monkeypatch.setattr(figures, "_draw_panel", keep)
    y = Axis("Torque", "N m", "mN m", scale=scale)  # type: ignore[arg-type]
    panel = Panel(Axis("Rate"), y, [curve])
    figures.draw(Figure("key", "Title", "Caption", "Alt", (panel,)))
    return found[0]


def bars(ax: Axes) -> list[tuple[float, float]]:
    """Lower and upper end of every bar, by its x."""
    (line,) = [line for line in ax.lines if line.get_gid() == curves.BARS]
    ends = np.asarray(line.get_ydata(), dtype=float).reshape(-1, 3)
    return [(float(low), float(high)) for low, high, gap in ends]


X = np.array([1.0, 2.0, 3.0])


def test_points_have_bars_where_there_is_an_interval(monkeypatch: pytest.MonkeyPatch) -> None:
    lopsided = replace(estimate(0.003, 0.0), low=0.0025, high=0.005)
    found = [estimate(0.002, 0.0005), ALONE, lopsided]
    found[1] = replace(found[1], value=0.001)
    ax = drawn(Curve.of(X, found, "a", "lugre"), monkeypatch)
    assert np.array(bars(ax)) == pytest.approx(np.array([(1.5, 2.5), (2.5, 5.0)]))


def test_a_bound_is_open_on_one_side() -> None:
    """At least 4, off by 0.5 of its own: from 4 less 1.645 times 0.5."""
    bound = Estimate("t", 4.0, "N m", kind="at least", systematic=(Systematic("inertia", 0.5),))
    most = Estimate("t", 4.0, "N m", kind="at most")
    curve = Curve.of(np.array([1.0, 2.0, 3.0]), [bound, most, estimate(1.0, 0.1)])
    assert curve.low == pytest.approx([4.0 - 1.645 * 0.5, -np.inf, 0.9], abs=0.01)
    assert curve.high == pytest.approx([np.inf, 4.0, 1.1], abs=0.01)


def test_a_line_has_a_band(monkeypatch: pytest.MonkeyPatch) -> None:
    curve = Curve.of(X, [estimate(v, 0.1) for v in (1.0, 2.0, 3.0)], "a", "lugre", "line")
    (band,) = drawn(curve, monkeypatch).collections
    reach = band.get_datalim(band.axes.transData)  # type: ignore[union-attr]
    assert (reach.y0, reach.y1) == pytest.approx((900.0, 3100.0))


def test_the_systematic_part_is_in_the_bar(monkeypatch: pytest.MonkeyPatch) -> None:
    shifted = estimate(1.0, 0.3, systematic=(Systematic("inertia", 0.4 / 1.959964),))
    ax = drawn(Curve.of(X[:1], [shifted], "a", "lugre"), monkeypatch)
    assert bars(ax)[0] == pytest.approx((500.0, 1500.0))


def test_bars_are_in_sight_unless_they_would_hide_the_points(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    wide = drawn(Curve.of(X, [estimate(7.0, 1.0)] * 3, "a", "lugre"), monkeypatch)
    low, high = wide.get_ylim()
    assert low < 6000.0 < 8000.0 < high  # although the numbers are all the same
    found = [estimate(1.0, 0.1), estimate(2.0, 900.0), estimate(3.0, 0.1)]
    cut = drawn(Curve.of(X, found, "a", "lugre"), monkeypatch)
    low, high = cut.get_ylim()
    assert -3000.0 < low < 900.0
    assert 3100.0 < high < 7000.0


def test_a_logarithmic_axis_shows_a_bar_that_reaches_zero(monkeypatch: pytest.MonkeyPatch) -> None:
    found = [estimate(0.1, 0.05), estimate(0.01, 0.02), estimate(1.0, 0.1)]
    ax = drawn(Curve.of(X, found, "a", "lugre"), monkeypatch, "log")
    bottom, top = ax.get_ylim()
    assert bottom == pytest.approx(5.0)
    assert top > 1000.0
    ends = bars(ax)
    assert ends[1][0] < bottom
    assert ends[1][1] == pytest.approx(30.0)
