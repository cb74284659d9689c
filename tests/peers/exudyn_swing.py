"""Run by Exudyn's own interpreter: an exported body as an ObjectFFRFreducedOrder, held and then swinging.

    python exudyn_swing.py body_exudyn.npz job.json out.npz

job: `frequency` of the first mode in Hz, `nodal`: file with nodes, M, K and shapes of the full model, or null.
Writes: frequencies of the held body, a free vibration of its first modal coordinate, a free swing about the frame's
y axis under gravity along +z, and Exudyn's own integrals from M for comparison.
"""

import json
import sys

import exudyn as exu
import numpy as np
import scipy.sparse as sp
from exudyn.FEM import FEMinterface, ObjectFFRFreducedOrderInterface
from exudyn.itemInterface import GenericJoint, MarkerBodyRigid, MarkerNodeRigid, ObjectGround, SensorNode

file, job, out = sys.argv[1], json.load(open(sys.argv[2])), sys.argv[3]
body = ObjectFFRFreducedOrderInterface()
body.LoadFromFile(file)
found = {}


def system(free_axes, gravity):
    mbs = exu.SystemContainer().AddSystem()
    items = body.AddObjectFFRFreducedOrderWithUserFunctions(exu, mbs, gravity=gravity)
    ground = mbs.AddMarker(MarkerBodyRigid(bodyNumber=mbs.AddObject(ObjectGround())))
    frame = mbs.AddMarker(MarkerNodeRigid(nodeNumber=items["nRigidBody"]))
    mbs.AddObject(GenericJoint(markerNumbers=[ground, frame], constrainedAxes=[1, 1, 1, 1, 0 if free_axes else 1, 1]))
    return mbs, items


def run(mbs, sensor, end, steps):
    settings = exu.SimulationSettings()
    settings.timeIntegration.endTime, settings.timeIntegration.numberOfSteps = end, steps
    settings.timeIntegration.generalizedAlpha.spectralRadius = 0.98
    settings.timeIntegration.verboseMode = 0
    settings.solutionSettings.sensorsWritePeriod = end / steps
    settings.solutionSettings.writeSolutionToFile = False
    mbs.SolveDynamic(settings)
    return mbs.GetSensorStoredData(sensor)


# held: eigenvalues and a free vibration of the first modal coordinate
mbs, items = system(False, [0, 0, 0])
start = np.zeros(body.nModes)
start[0] = 1e-6
mbs.SetNodeParameter(items["nGenericODE2"], "initialCoordinates", list(start))
node = items["nGenericODE2"]
sensor = mbs.AddSensor(
    SensorNode(nodeNumber=node, storeInternal=True, outputVariableType=exu.OutputVariableType.Coordinates)
)
mbs.Assemble()
values = mbs.ComputeODE2Eigenvalues(convert2Frequencies=True)[0]
found["frequencies"] = np.sort(np.asarray(values))
found["vibration"] = run(mbs, sensor, 10 / job["frequency"], 2000)

# swinging
mbs, items = system(True, [0, 0, 9.81])
sensor = mbs.AddSensor(
    SensorNode(nodeNumber=items["nRigidBody"], storeInternal=True, outputVariableType=exu.OutputVariableType.Rotation)
)
modal = mbs.AddSensor(
    SensorNode(
        nodeNumber=items["nGenericODE2"], storeInternal=True, outputVariableType=exu.OutputVariableType.Coordinates
    )
)
mbs.Assemble()
found["swing"] = run(mbs, sensor, job["time"], job["steps"])
found["swing_modal"] = mbs.GetSensorStoredData(modal)

if job.get("nodal"):
    full = np.load(job["nodal"])
    fem = FEMinterface()
    fem.nodes = {"Position": full["nodes"]}
    fem.massMatrix, fem.stiffnessMatrix = sp.csr_matrix(full["M"]), sp.csr_matrix(full["K"])
    fem.modeBasis = {"matrix": full["shapes"], "type": "NormalModes"}
    own = ObjectFFRFreducedOrderInterface(fem)
    for name, value in own.GetDictionary().items():
        if isinstance(value, np.ndarray) and value.dtype == float:
            found["own_" + name] = value
np.savez(out, **found)
