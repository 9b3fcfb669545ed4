"""How the file of a reconstruction names itself: apart, to be known without loading what makes one."""

FORMAT = "bentray-reconstruction"
VERSION = "1.0"
