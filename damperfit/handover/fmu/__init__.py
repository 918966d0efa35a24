"""FMUs: the compiled core behind the doors of the Functional Mock-up Interface 2.0 and 3.0.

The library in an FMU holds no damper: it is built once, with the wheel for the host and on request
for others, and reads ``resources/damper.txt``. So exporting is writing a zip.
"""

__all__: list[str] = []
