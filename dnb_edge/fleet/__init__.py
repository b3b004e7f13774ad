"""Several boxes: what each publishes over MQTT, and the hub that shows all. Processes of their own beside the daemon."""
