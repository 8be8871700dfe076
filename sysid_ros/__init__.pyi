from sysid_ros.library import Recording as Recording
from sysid_ros.library import Robot as Robot
from sysid_ros.library import diagnose as diagnose
from sysid_ros.library import excite as excite
from sysid_ros.library import frequency as frequency
from sysid_ros.library import identify as identify
from sysid_ros.library import load as load
from sysid_ros.library import replay as replay

__version__: str
__all__: list[str]
