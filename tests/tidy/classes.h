// Counts the members and private functions of classes.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "tree.h"

namespace nodal::tidy {

struct ClassSize {
  std::string name;
  std::size_t members = 0;  ///< data that each object has
  std::size_t private_functions = 0;
};

/// The classes of a source, also those within other classes; no structs, which are records.
std::vector<ClassSize> classes_in(const TextFile& file);

}  // namespace nodal::tidy
