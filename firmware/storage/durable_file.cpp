#include "firmware/storage/durable_file.h"

#include <cstdint>
#include <span>

#include "protocol/base/try.h"

namespace nodal::firmware {
namespace {

/// One that an interrupted write left is removed first: it never was a file's contents.
Result<hal::FileHandle> create_temporary(hal::DiskPort& disk, const std::string& name) {
  auto handle = disk.create(name);
  if (handle || handle.error().code != Errc::kExists) return handle;
  NODAL_TRY(disk.remove(name));
  return disk.create(name);
}

Status put(hal::DiskPort& disk, const std::string& folder, const std::string& file, std::string_view text,
           Status (hal::DiskPort::*rename)(const std::string&, const std::string&)) {
  const std::string temporary = file + std::string(kTemporarySuffix);
  NODAL_TRY_ASSIGN(const auto handle, create_temporary(disk, temporary));
  Status done = disk.write(handle, std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
  if (done) done = disk.sync(handle);
  disk.close(handle);
  if (done) done = (disk.*rename)(temporary, file);
  if (!done) {
    (void)disk.remove(temporary);  // the incomplete file occupies space, and the disk may be full
    return fail(done.error());
  }
  return disk.sync_folder(folder);
}

}  // namespace

Status write_durably(hal::DiskPort& disk, const std::string& folder, const std::string& file, std::string_view text) {
  return put(disk, folder, file, text, &hal::DiskPort::rename);
}

Status create_durably(hal::DiskPort& disk, const std::string& folder, const std::string& file, std::string_view text) {
  return put(disk, folder, file, text, &hal::DiskPort::rename_new);
}

}  // namespace nodal::firmware
