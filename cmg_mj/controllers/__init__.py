"""Runs the controller: sensors, tilt, observer and law once a control period."""
