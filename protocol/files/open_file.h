// Opens files without waiting.
#pragma once

#include <cstdio>
#include <filesystem>
#include <memory>

#include "protocol/base/result.h"

namespace nodal {

struct CloseFile {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using FilePtr = std::unique_ptr<std::FILE, CloseFile>;

/// Opens a regular file to read it; follows links. Errors: kNotFound, kIo; kBadFormat for a folder, a FIFO, a socket or
/// a device. The message does not name the file: the caller knows what it is for.
Result<FilePtr> open_to_read(const std::filesystem::path& file);

/// The same for a program that reads by descriptor. The caller closes it.
Result<int> open_descriptor_to_read(const std::filesystem::path& file);

/// Opens a file for writing that a user named: makes it, or writes into what is there. A FIFO must have a reader,
/// otherwise the error says so. The caller closes the descriptor, whose writes wait as usual.
Result<int> open_descriptor_to_write(const std::filesystem::path& file);

/// Makes a file that is not there yet. Errors: kExists; those of open_to_read().
Result<FilePtr> create_to_write(const std::filesystem::path& file);

/// Makes a file without a name in a folder, to write and read; it is gone when it is closed. The caller closes it.
Result<int> open_unnamed(const std::filesystem::path& folder);

}  // namespace nodal
