"""What a run's page says of what vehicles told."""

from dnb_edge.report.vehicle import VehicleTold, vehicle_section, vehicles_told
from dnb_edge.values import VehicleReport


def said(car: int, inference_ms: float | None, *, missing: int = 0, rate_hz: float | None = None) -> VehicleReport:
    return VehicleReport(
        t_ns=0,
        t_s=0.0,
        came_ns=0,
        car=car,
        seq=None,
        inference_ms=inference_ms,
        steering=None,
        throttle=None,
        rate_hz=rate_hz,
        missing=missing,
        refused=0,
    )


def test_each_car_is_told_in_a_line() -> None:
    """Percentiles of the times that it told, the median of its rate, what is missing; cars in the order of their numbers."""
    reports = [said(2, float(ms), missing=ms // 50, rate_hz=30.0 + ms % 3) for ms in range(101)] + [said(1, None)]
    told = vehicles_told(reports)
    assert told == (
        VehicleTold(car=1, lines=1, missing=0, inference_ms=None, rate_hz=None),
        VehicleTold(car=2, lines=101, missing=2, inference_ms=(50.0, 95.0, 99.0), rate_hz=31.0),
    )
    page = vehicle_section(told)
    assert page.startswith("<section>\n<h2>Vehicles</h2>")
    assert "<td>50.0</td><td>95.0</td><td>99.0</td><td>31.0</td><td>101</td><td>2</td>" in page


def test_where_no_vehicle_spoke_there_is_nothing() -> None:
    """Most runs' pages have no such section."""
    assert vehicle_section(vehicles_told(())) == ""
