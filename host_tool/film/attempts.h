// Names of files that are being written, until they are whole, and what killed processes have left of them.
#pragma once

#include <string>

namespace nodal::film {

/// FILE.part-HOST-PID: a name that no other attempt has, on this machine or another.
std::string attempt_name(const std::string& file);

/// Removes the attempts at `file`, files or folders, and at everything in a folder if it ends in '/', whose process of
/// this machine is gone. Those of other machines stay: nothing here tells whether they still write.
void remove_dead_attempts(const std::string& file);

}  // namespace nodal::film
