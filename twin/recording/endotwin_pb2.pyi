from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable
from typing import ClassVar as _ClassVar, Optional as _Optional

DESCRIPTOR: _descriptor.FileDescriptor

class Command(_message.Message):
    __slots__ = ("pull_mm", "lateral_pull_mm")
    PULL_MM_FIELD_NUMBER: _ClassVar[int]
    LATERAL_PULL_MM_FIELD_NUMBER: _ClassVar[int]
    pull_mm: float
    lateral_pull_mm: float
    def __init__(self, pull_mm: _Optional[float] = ..., lateral_pull_mm: _Optional[float] = ...) -> None: ...

class Truth(_message.Message):
    __slots__ = ("truth_deg", "wire_tension_a_n", "wire_tension_b_n", "sheath_friction_a_n", "sheath_friction_b_n", "lateral_bend_deg", "pulley_mm", "sheath_bend_deg", "wire_tension_c_n", "wire_tension_d_n", "sheath_friction_c_n", "sheath_friction_d_n", "wire_slack_a_mm", "wire_slack_b_mm", "wire_slack_c_mm", "wire_slack_d_mm")
    TRUTH_DEG_FIELD_NUMBER: _ClassVar[int]
    WIRE_TENSION_A_N_FIELD_NUMBER: _ClassVar[int]
    WIRE_TENSION_B_N_FIELD_NUMBER: _ClassVar[int]
    SHEATH_FRICTION_A_N_FIELD_NUMBER: _ClassVar[int]
    SHEATH_FRICTION_B_N_FIELD_NUMBER: _ClassVar[int]
    LATERAL_BEND_DEG_FIELD_NUMBER: _ClassVar[int]
    PULLEY_MM_FIELD_NUMBER: _ClassVar[int]
    SHEATH_BEND_DEG_FIELD_NUMBER: _ClassVar[int]
    WIRE_TENSION_C_N_FIELD_NUMBER: _ClassVar[int]
    WIRE_TENSION_D_N_FIELD_NUMBER: _ClassVar[int]
    SHEATH_FRICTION_C_N_FIELD_NUMBER: _ClassVar[int]
    SHEATH_FRICTION_D_N_FIELD_NUMBER: _ClassVar[int]
    WIRE_SLACK_A_MM_FIELD_NUMBER: _ClassVar[int]
    WIRE_SLACK_B_MM_FIELD_NUMBER: _ClassVar[int]
    WIRE_SLACK_C_MM_FIELD_NUMBER: _ClassVar[int]
    WIRE_SLACK_D_MM_FIELD_NUMBER: _ClassVar[int]
    truth_deg: float
    wire_tension_a_n: _containers.RepeatedScalarFieldContainer[float]
    wire_tension_b_n: _containers.RepeatedScalarFieldContainer[float]
    sheath_friction_a_n: _containers.RepeatedScalarFieldContainer[float]
    sheath_friction_b_n: _containers.RepeatedScalarFieldContainer[float]
    lateral_bend_deg: float
    pulley_mm: float
    sheath_bend_deg: float
    wire_tension_c_n: _containers.RepeatedScalarFieldContainer[float]
    wire_tension_d_n: _containers.RepeatedScalarFieldContainer[float]
    sheath_friction_c_n: _containers.RepeatedScalarFieldContainer[float]
    sheath_friction_d_n: _containers.RepeatedScalarFieldContainer[float]
    wire_slack_a_mm: _containers.RepeatedScalarFieldContainer[float]
    wire_slack_b_mm: _containers.RepeatedScalarFieldContainer[float]
    wire_slack_c_mm: _containers.RepeatedScalarFieldContainer[float]
    wire_slack_d_mm: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, truth_deg: _Optional[float] = ..., wire_tension_a_n: _Optional[_Iterable[float]] = ..., wire_tension_b_n: _Optional[_Iterable[float]] = ..., sheath_friction_a_n: _Optional[_Iterable[float]] = ..., sheath_friction_b_n: _Optional[_Iterable[float]] = ..., lateral_bend_deg: _Optional[float] = ..., pulley_mm: _Optional[float] = ..., sheath_bend_deg: _Optional[float] = ..., wire_tension_c_n: _Optional[_Iterable[float]] = ..., wire_tension_d_n: _Optional[_Iterable[float]] = ..., sheath_friction_c_n: _Optional[_Iterable[float]] = ..., sheath_friction_d_n: _Optional[_Iterable[float]] = ..., wire_slack_a_mm: _Optional[_Iterable[float]] = ..., wire_slack_b_mm: _Optional[_Iterable[float]] = ..., wire_slack_c_mm: _Optional[_Iterable[float]] = ..., wire_slack_d_mm: _Optional[_Iterable[float]] = ...) -> None: ...

class Measurement(_message.Message):
    __slots__ = ("measured_deg",)
    MEASURED_DEG_FIELD_NUMBER: _ClassVar[int]
    measured_deg: float
    def __init__(self, measured_deg: _Optional[float] = ...) -> None: ...

class Tension(_message.Message):
    __slots__ = ("tension_a_n", "tension_b_n", "tension_c_n", "tension_d_n")
    TENSION_A_N_FIELD_NUMBER: _ClassVar[int]
    TENSION_B_N_FIELD_NUMBER: _ClassVar[int]
    TENSION_C_N_FIELD_NUMBER: _ClassVar[int]
    TENSION_D_N_FIELD_NUMBER: _ClassVar[int]
    tension_a_n: float
    tension_b_n: float
    tension_c_n: float
    tension_d_n: float
    def __init__(self, tension_a_n: _Optional[float] = ..., tension_b_n: _Optional[float] = ..., tension_c_n: _Optional[float] = ..., tension_d_n: _Optional[float] = ...) -> None: ...

class Estimate(_message.Message):
    __slots__ = ("estimate_deg", "low_deg", "high_deg")
    ESTIMATE_DEG_FIELD_NUMBER: _ClassVar[int]
    LOW_DEG_FIELD_NUMBER: _ClassVar[int]
    HIGH_DEG_FIELD_NUMBER: _ClassVar[int]
    estimate_deg: float
    low_deg: float
    high_deg: float
    def __init__(self, estimate_deg: _Optional[float] = ..., low_deg: _Optional[float] = ..., high_deg: _Optional[float] = ...) -> None: ...

class Health(_message.Message):
    __slots__ = ("faults", "alarms", "source")
    FAULTS_FIELD_NUMBER: _ClassVar[int]
    ALARMS_FIELD_NUMBER: _ClassVar[int]
    SOURCE_FIELD_NUMBER: _ClassVar[int]
    faults: _containers.RepeatedScalarFieldContainer[str]
    alarms: _containers.RepeatedScalarFieldContainer[str]
    source: str
    def __init__(self, faults: _Optional[_Iterable[str]] = ..., alarms: _Optional[_Iterable[str]] = ..., source: _Optional[str] = ...) -> None: ...
