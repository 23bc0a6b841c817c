// Where another program's file is.
#pragma once

#include <string>
#include <string_view>

namespace nodal {

/// The file of a program, as execvp() finds it in $PATH; empty: there is none.
std::string find_program(std::string_view name);
/// What else must be executable for it: the loader that an ELF program names.
std::string loader_of(const std::string& program);

}  // namespace nodal
