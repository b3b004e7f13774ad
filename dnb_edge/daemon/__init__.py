"""The running appliance: threads, queues, health and the watchdog round the pure core."""
