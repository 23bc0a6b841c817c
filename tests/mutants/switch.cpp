#include "switch.h"

#include <cstdlib>

namespace nodal::mutants {
namespace {

int selected_by_environment() noexcept {
  const char* const number = std::getenv("NODAL_MUTANT");
  return number ? std::atoi(number) : 0;
}

}  // namespace

int selected = selected_by_environment();
unsigned char reached[kMaxChanges];

}  // namespace nodal::mutants
