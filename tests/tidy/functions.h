// Extracts the functions of a source file by their braces, to find duplicates.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "tree.h"

namespace nodal::tidy {

struct Function {
  std::string file;
  std::size_t line = 0;   ///< line of its opening brace, from 1
  std::size_t lines = 0;  ///< between its braces, without blank lines and comments
  std::string body;       ///< from brace to brace, without white space and comments
  std::string shape;      ///< the body with each name replaced by the index of its first use
};

/// The text with blanks for comments and for what is in literals, so that its brackets can be counted.
std::string brackets_of(const TextFile& file);

/// Functions and lambdas, also nested ones; no control statements.
std::vector<Function> functions_in(const TextFile& file);

/// One sentence for each pair of duplicate functions: equal bodies of at least `lines_alike` lines, or bodies of at
/// least `lines_renamed` lines that differ only in names.
std::vector<std::string> repeated_functions(const std::vector<TextFile>& files, std::size_t lines_alike,
                                            std::size_t lines_renamed);

}  // namespace nodal::tidy
