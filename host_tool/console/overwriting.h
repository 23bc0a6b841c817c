// What exists is not written over: the rule for every file that a command writes where its user says.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::host {

/// Whether files that are there are replaced (--overwrite). Otherwise only those that this process wrote. Holds for the
/// process, as a umask does.
///
/// Threading: set before there are other threads; the other functions are for all threads.
void set_overwriting(bool on);

/// Whether a file may be written at this name: nothing is there, it may be replaced, or it is no regular file
/// (/dev/null, a FIFO).
/// Errors: kExists, naming the file.
Status check_free(const std::string& path);

/// This process wrote the file, or it is a part that an earlier run of the same command left: it may be replaced.
void note_own(const std::string& path);

/// Renames to a name that nothing has yet. Returns 0 or an errno: EEXIST if there is anything.
int rename_to_new(const std::string& from, const std::string& to);
/// The same, but in the place of a file that check_free() lets be replaced.
int rename_to_free(const std::string& from, const std::string& to);
/// What EEXIST of these means.
Error is_there(const std::string& path);

/// Refuses to write over a picture that is read: nothing could bring it back. `out` may number its `count` files.
/// Errors: kExists, kBadValue; those of numbered_name().
Status check_output(const std::string& out, const std::vector<std::vector<std::string>>& sets, std::size_t count);

}  // namespace nodal::host
