"""A drive's result, for tests of what is made of many."""

from dnb_edge.nut.campaign import TrialLap, TrialResult

LAP = TrialLap(
    number=1, time_s=8.0, sigma_s=0.001, official_s=8.0, valid=True, similarity_percent=90.0, penalty_factor=1.0, true_s=7.998
)  # fmt: skip
RESULT = TrialResult(
    driver="pure-pursuit", entry="pursuit", task="lane-following", seed=1, wanted_laps=2, laps=(LAP, LAP), collisions=0,
    true_collisions=0, off_track=0, to_start_s=0.8, true_laps=2, completed=True, ended="laps", failure=None, simulated_s=17.0,
    wall_s=3.0, recording="a.mcap",
)  # fmt: skip
