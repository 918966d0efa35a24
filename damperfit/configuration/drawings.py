"""Drawings and texts for measuring a damper's lengths and pressures on the bench."""

_CHAMBERS = """\
   rod
    |
  +-|-------------+  x = 0 at mid-stroke, positive in rebound (rod out)
  | |             |
  | | chamber 1   |  the rod passes through it; chamber_1_length from piston to rod guide
  | |             |
  |=+= piston ====|  rod_diameter above, piston_diameter across
  |               |
  |   chamber 2   |  the full bore; chamber_2_length from piston to {bottom}
  |               |
"""

# Drawing of a damper, by model.
DRAWINGS = {
    "purdy": _CHAMBERS.format(bottom="the valves below")
    + """\
  +-- valves 2, 3 +  valve 2 lets oil from chamber 2 to 1 in compression, 3 from 3 to 2 in rebound;
  |   chamber 3   |  valve 1 is the adjuster's orifice between chambers 1 and 3
  |== gas piston =|  gas_piston_diameter across
  |      gas      |  gas_length from gas piston to the end, gas_pressure at mid-stroke
  +---------------+""",
    "twin_tube": _CHAMBERS.format(bottom="the base valve")
    + """\
  +-- base valve -+  piston valves between chambers 1 and 2, base valve to the reserve
  |  reserve tube |  oil below, gas above it: gas_volume and gas_pressure at mid-stroke
  +---------------+""",
    "monotube": _CHAMBERS.format(bottom="the gas piston")
    + """\
  |== gas piston =|  valves in the piston for each stroke; the gas piston floats
  |      gas      |  gas_volume and gas_pressure at mid-stroke
  +---------------+""",
    "through_flow": _CHAMBERS.format(bottom="the end of the bore")
    + """\
  +---------------+  the piston is solid: each chamber presses through a valve to the reservoir
      reservoir      gas_volume and gas_pressure of it at mid-stroke""",
}

# Key of [damper]: what it is and how it is measured.
MEASURED = {
    "rod_diameter": "d_r; micrometer on the rod, where it runs in the seal",
    "piston_diameter": "d_p; bore of the working tube, not the piston",
    "gas_piston_diameter": "d_g; bore where the gas piston runs",
    "chamber_1_length": "l_1 at mid-stroke: oil from piston to rod guide",
    "chamber_2_length": "l_2 at mid-stroke: oil from piston to the end of chamber 2",
    "gas_length": "l_g at mid-stroke: gas piston to the end of the gas",
    "gas_volume": "at mid-stroke: what is not oil; from the mass of oil, or length and bore",
    "gas_pressure": "P_0 at mid-stroke; say bara or barg, psia or psig",
    "gas_exponent": "gamma; 1.4 fast compression of nitrogen, 1.0 slow",
    "oil_density": "rho_0; data sheet, or a syringe and a scale",
    "ambient_pressure": "of the air, on the rod: 1.013bara at sea level; 0bara leaves it out",
}
