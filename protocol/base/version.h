// The version of nodald and nodal. CMakeLists.txt reads this line, so the number stands nowhere else.
#pragma once

#define NODAL_VERSION "0.2.0"
