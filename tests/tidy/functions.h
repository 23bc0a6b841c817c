// The functions of a source file, cut out by their braces, so that two with one body are found.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "tree.h"

namespace nodal::tidy {

struct Function {
  std::string file;
  std::size_t line = 0;   ///< of its opening brace, from 1
  std::size_t lines = 0;  ///< between its braces, blank ones and comments not counted
  std::string body;       ///< from brace to brace, without blanks and comments
  std::string shape;      ///< the body with each name replaced by the order of its first use
};

/// Functions and lambdas; control statements are not taken for functions. A function inside a function is listed, too.
std::vector<Function> functions_in(const TextFile& file);

/// One sentence for each pair of functions that say the same: the same body of `lines_alike` lines or more, or the same
/// but for names of `lines_renamed` lines or more.
std::vector<std::string> repeated_functions(const std::vector<TextFile>& files, std::size_t lines_alike,
                                            std::size_t lines_renamed);

}  // namespace nodal::tidy
