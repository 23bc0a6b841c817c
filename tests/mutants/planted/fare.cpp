#include "fare.h"

namespace nodal::planted {

int fare(int age) {
  if (age < 0) return 0;
  return age >= 18 ? 10 : 5;
}

}  // namespace nodal::planted
