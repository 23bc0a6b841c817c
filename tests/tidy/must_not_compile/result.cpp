// Code that must compile, and one misuse at a time that must not: MISUSE selects it.
#include "protocol/base/result.h"

nodal::Result<int> answer();

int use() {
  const nodal::Result<int> result = answer();
  if (!result) return static_cast<int>(result.error().code);
#if MISUSE == 1
  const int value = result;  // a Result does not convert to its value
  return value;
#elif MISUSE == 2
  return result.error().code;  // an error code does not convert to an integer
#else
  return *result;
#endif
}
