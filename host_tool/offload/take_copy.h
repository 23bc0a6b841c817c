// A copy of a take on the host: fetched from a rig, compared with the hashes of its recording, continued after
// interruptions.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "host_tool/offload/local_file.h"
#include "host_tool/rig/rig_connection.h"
#include "protocol/base/result.h"
#include "protocol/base/sha256.h"
#include "protocol/take/documents.h"

namespace nodal::host {

/// Threading: thread-bound.
/// Ownership: has the folder for itself. The connection outlives it.
/// What exists is never written over: neither files of another take, nor one of this take that was changed.
///
/// Errors: those of fetch_file(); kDiskFull, kIo, kNotFound of the host's disk; kWrongState if the folder holds another
///   take of this number, or other files with its names; kBusy while another program copies to it; kChecksum if bytes
///   differ from those that were recorded, kTries times.
class TakeCopy {
 public:
  /// Bytes of the take that are there and verified, and the file that is being copied.
  using OnProgress = std::function<void(std::uint64_t bytes, const std::string& file)>;

  /// Fetches the manifest, and makes the folder `to`/000042.
  static Result<TakeCopy> begin(RigConnection& rig, std::uint64_t take, const std::filesystem::path& to);

  const take::Manifest& manifest() const { return manifest_; }
  /// SHA-256 of the manifest: identifies the take.
  const Sha256& id() const { return id_; }
  const std::filesystem::path& folder() const { return folder_; }
  /// All of it is there, by an earlier copy.
  bool complete() const;
  /// Bytes of the files to copy: all, or those that are not a head's pictures.
  std::uint64_t bytes(bool without_heads) const;

  /// Copies what is missing. When it returns, everything is on the host's disk. Without heads the copy stays
  /// unfinished: it has no manifest.
  Status run(bool without_heads, const OnProgress& progress);

  /// Bytes that this object fetched.
  std::uint64_t fetched() const { return fetched_; }

  static constexpr int kTries = 3;

 private:
  TakeCopy(RigConnection& rig, std::filesystem::path folder, FolderLock lock)
      : rig_(&rig), folder_(std::move(folder)), lock_(std::move(lock)) {}
  Status claim_folder(std::span<const std::uint8_t> manifest);
  Status check_names(bool and_parts) const;
  bool is_complete(const take::Manifest::File& file) const;
  Status check_room(bool without_heads) const;
  Status copy_document(const take::Manifest::File& file, const OnProgress& progress);
  Status note_hashes(const take::Manifest::File& file, std::span<const std::uint8_t> evidence);
  Status copy_video(const take::Manifest::File& file, const OnProgress& progress);

  RigConnection* rig_;
  std::filesystem::path folder_;
  FolderLock lock_;
  take::Manifest manifest_;
  Sha256 id_{};
  bool without_heads_ = false;
  /// Hashes of the pieces of the video files that are copied, from the evidence. check_room() bounds their number.
  std::map<std::string, std::vector<take::Xxh128>> hashes_;
  std::uint64_t done_ = 0;
  std::uint64_t fetched_ = 0;
};

}  // namespace nodal::host
