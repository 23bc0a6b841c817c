#include "firmware/storage/durable_file.h"

#include <cstdint>
#include <span>

namespace nodal::firmware {

Status write_durably(hal::DiskPort& disk, const std::string& folder, const std::string& file, std::string_view text) {
  const std::string temporary = file + std::string(kTemporarySuffix);
  const auto handle = disk.create(temporary);
  if (!handle) return fail(handle.error());
  Status done = disk.write(*handle, std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
  if (done) done = disk.sync(*handle);
  disk.close(*handle);
  if (done) done = disk.rename(temporary, file);
  if (!done) {
    (void)disk.remove(temporary);  // the incomplete file occupies space, and the disk may be full
    return fail(done.error());
  }
  return disk.sync_folder(folder);
}

}  // namespace nodal::firmware
