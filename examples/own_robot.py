"""A pair on a robot of your own: a torso on two feet, which stands on the line through them and would fall sideways.

On a command line, for a robot in a file: cmg-mj mount torso.xml --body torso --axis x --scale 1.3 -o balanced.xml
"""

import tempfile
from pathlib import Path

import mujoco

import cmg_mj
from cmg_mj.features.mounting.limits import push_limits
from cmg_mj.features.mounting.write import write_scenario

LEG = """
      <body pos="{0} 0 -0.16">
        <joint name="hip{0}" axis="0 1 0" damping="0.5"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.54" size="0.02" mass="0.8"/>
      </body>"""
TORSO = f"""
<mujoco model="torso">
  <worldbody>
    <geom type="plane" size="4 4 0.1"/>
    <body name="torso" pos="0 0 0.75">
      <freejoint/>
      <geom type="box" size="0.09 0.12 0.16" mass="4"/>{LEG.format(0.15)}{LEG.format(-0.15)}
    </body>
  </worldbody>
</mujoco>"""

mounted = cmg_mj.mount(mujoco.MjSpec.from_string(TORSO), body="torso", axis="x", scale=1.3)
with tempfile.TemporaryDirectory() as folder:
    model = mounted.save(Path(folder) / "balanced.xml")  # plain MuJoCo loads it too
    can = push_limits(write_scenario(model, model, "gyro_free"))
    experiment = write_scenario(model, model, "gyro_free", can)  # pushes with 0.6 of E
outcome = experiment.run().outcomes[0]
print(f"held: {', '.join(mounted.held)}; E is {can.fraction_of_limit:.0%} of what any law could recover from")
print(f"pushed with 0.6 of that: {'fell at' if outcome.fell else 'stood until'} {outcome.time_s:g} s")
