"""Events as a race gives them, for the tests of the displays."""

from dnb_edge import values
from dnb_edge.display.state import BoardState


def lap(number=1, start_s=2.0, time_s=12.483, *, valid=True, similarity=95.78, reasons=(), suspect=(), car=1, **more):
    return values.Lap(
        number=number,
        start_t_ns=round(start_s * 1e9),
        end_t_ns=round((start_s + time_s) * 1e9),
        start_s=start_s,
        time_s=time_s,
        sigma_s=0.0021,
        valid=valid,
        reasons=reasons,
        similarity_percent=similarity,
        observed_fraction=0.99,
        suspect=suspect,
        car=car,
        **more,
    )


def crossing(t_s, *, line="start", direction=values.Direction.FORWARD, car=1, status=None, lap=None):
    return values.Crossing(
        t_ns=round(t_s * 1e9),
        t_s=t_s,
        line=line,
        direction=direction,
        sigma_s=0.0015,
        track_m=(1.0, 0.5),
        target_id=car,
        estimated=False,
        car=car,
        status=status,
        lap=lap,
    )


def target(t_s, state=values.TargetState.CONFIRMED):
    return values.Target(
        target_id=1,
        state=state,
        t_ns=round(t_s * 1e9),
        t_s=t_s,
        track_m=(1.0, 0.5),
        velocity_mps=(1.0, 0.0),
        covariance_m2=(1e-4, 0.0, 1e-4),
    )


def health(t_s=3.0, *, warnings=(), notes=(), display="online", view_moved_m=None, saved_laps=None):
    return values.Health(
        t_ns=round(t_s * 1e9),
        t_s=t_s,
        frames=90,
        detected_frames=88,
        dropped_frames=0,
        fps=29.94,
        latency_ms=21.0,
        display=display,
        recording="recording",
        view_error_mean_px=None,
        view_error_mean_m=None,
        warnings=warnings,
        notes=notes,
        view_moved_m=view_moved_m,
        saved_laps=saved_laps,
    )


def running(t_s, *, car=1, delta_s=None, similarity=None):
    return values.Running(
        t_ns=round(t_s * 1e9),
        t_s=t_s,
        car=car,
        target_id=car,
        lap=1,
        elapsed_s=1.0,
        track_m=(1.0, 0.5),
        s_m=1.0,
        d_m=0.01,
        speed_mps=1.2,
        similarity_percent=similarity,
        delta_s=delta_s,
        ghost_m=None,
    )


def race_state(t_s, phase, *, countdown_s=None, remaining_s=None, text=""):
    return values.RaceState(
        t_ns=round(t_s * 1e9),
        t_s=t_s,
        phase=phase,
        countdown_s=countdown_s,
        remaining_s=remaining_s,
        text=text,
    )


def standings(t_s, *cars, tied=False):
    """Cars in the order given, a tenth apart."""
    rows = tuple(
        values.Standing(
            place=1 if tied else place,
            tied=tied,
            car=car,
            name=f"car {car}",
            laps=3,
            valid_laps=3,
            value=10.0 + 0.1 * place,
            sigma=0.002,
            best_lap_s=10.0 + 0.1 * place,
            last_lap_s=11.0,
            gap=None if place == 1 else 0.1 * (place - 1),
            interval=None if place == 1 else 0.1,
        )
        for place, car in enumerate(cars, start=1)
    )
    return values.Standings(t_ns=round(t_s * 1e9), t_s=t_s, rank_by="best_lap", unit="s", final=False, rows=rows)


def incident(text="the car left the lane for 0.8 s, by up to 120 mm", *, car=1, start_s=4.0):
    return values.Incident(
        number=1,
        kind=values.IncidentKind.OFF_TRACK,
        car=car,
        target_id=car,
        lap=1,
        start_t_ns=round(start_s * 1e9),
        end_t_ns=round((start_s + 0.8) * 1e9),
        start_s=start_s,
        lasted_s=0.8,
        greatest_m=0.12,
        worst_t_ns=round((start_s + 0.4) * 1e9),
        track_m=(1.0, 0.5),
        camera_px=(100.0, 100.0),
        s_m=1.0,
        text=text,
    )


def run_summary(laps=3):
    return values.RunSummary(frames=900, detected_frames=890, laps=laps, recording=None)


def board(*events, **fields):
    """The board after `events`."""
    state = BoardState(**fields)
    for event in events:
        state = state.after(event)
    return state


def race(laps, *, start_s=2.0, time_s=10.0, **fields):
    """The board after an out lap and `laps` laps of `time_s`."""
    state = board(target(1.0), crossing(start_s), **fields)
    for number in range(1, laps + 1):
        begin_s = start_s + (number - 1) * time_s
        state = state.after(crossing(begin_s + time_s)).after(lap(number, begin_s, time_s))
    return state
