// What must compile, and one misuse at a time that must not: MISUSE picks it.
#include "protocol/base/result.h"

nodal::Result<int> answer();

int use() {
  const nodal::Result<int> result = answer();
  if (!result) return static_cast<int>(result.error().code);
#if MISUSE == 1
  const int value = result;  // a result is not its value before it was checked
  return value;
#elif MISUSE == 2
  return result.error().code;  // an error's number is not an integer by accident
#else
  return *result;
#endif
}
