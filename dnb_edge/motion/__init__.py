"""Following cars over time: a Kalman filter, association, and the life cycle of a target.

Knows observations in metres and their stamps; reads no clock."""
