// The version of nodald and nodal. CMakeLists.txt reads this line; it is the only place that states the number.
#pragma once

#define NODAL_VERSION "0.2.0"
