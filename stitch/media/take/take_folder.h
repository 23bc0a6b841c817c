// Reads the folder of a take (protocol/TAKE.md).
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "protocol/base/field.h"
#include "protocol/base/image.h"
#include "protocol/base/result.h"
#include "protocol/base/units.h"
#include "protocol/take/documents.h"
#include "protocol/take/evidence.h"
#include "protocol/take/stream.h"
#include "stitch/media/take/segment_rules.h"
#include "stitch/media/take/take_files.h"

namespace nodal::media {

/// One segment. Whatever is read is compared with the hashes in the evidence first.
///
/// Threading: thread-bound.
/// Ownership: owns the open files, and the newest MiB of each.
/// Errors: see TakeFolder.
class TakeSegment {
 public:
  const take::Segment& evidence() const { return evidence_; }
  const SetsBefore& before() const { return before_; }
  /// For TakeFolder::segment() of the next one.
  SetsBefore after() const { return {before_.kept + evidence_.sets.size(), before_.deleted}; }
  /// By the number of the file in the evidence.
  const std::vector<take::StreamFile>& streams() const { return streams_; }
  /// Replaces `into` by bytes of a file, such as those of a frame.
  Status read(std::uint32_t file, std::uint64_t at, std::uint64_t bytes, std::vector<std::uint8_t>& into);

 private:
  friend class TakeFolder;
  struct File {
    std::unique_ptr<TakeFile> file;
    std::string shown;  ///< its name in messages
    std::vector<take::Xxh128> hashes;
    std::vector<std::uint8_t> piece{};  ///< the newest that was read
    std::optional<std::uint64_t> piece_number{};
  };
  Status open_files(TakeFiles& files, const take::Manifest& manifest);
  Status load(File& file, std::uint64_t piece);

  take::Segment evidence_;
  SetsBefore before_;
  std::vector<take::StreamFile> streams_;
  std::vector<File> files_;
};

/// Threading: thread-bound.
/// Ownership: shares the files' folder.
/// Errors: each names the file. kNotReady for a take that was not ended, and for a copy that is not complete; kNotFound
///   for what is missing, a symbolic link or a device; kBadFormat for what contradicts itself; kChecksum for bytes that
///   differ from the manifest or the hashes; those of take::parse_manifest() and take::read_evidence(); kTooLarge.
class TakeFolder {
 public:
  /// Reads take.json and the manifest.
  static Result<TakeFolder> open(std::shared_ptr<TakeFiles> files);

  /// A file's name in messages.
  std::string shown(const std::string& name) const { return files_->shown(name); }
  const take::TakeDocument& about() const { return about_; }
  const take::Manifest& manifest() const { return manifest_; }
  bool has(const std::string& name) const { return find(name) != nullptr; }
  /// The text of a document, such as "rig.toml".
  Result<std::string> text(const std::string& name, std::uint64_t limit) const;

  std::size_t segments() const { return segments_.size(); }
  /// Segment `k` of them, in the order of recording; `before`: after() of the one before it. Between the two there may
  /// be deleted sets, as many as the manifest says for the whole take at most.
  Result<TakeSegment> segment(std::size_t k, SetsBefore before) const;

 private:
  const take::Manifest::File* find(const std::string& name) const;
  Result<std::vector<std::uint8_t>> whole(const std::string& name, std::uint64_t limit) const;

  std::shared_ptr<TakeFiles> files_;
  take::TakeDocument about_;
  take::Manifest manifest_;
  std::vector<std::uint32_t> segments_;  ///< their numbers, rising
};

/// One head in a set.
struct TakeFrame {
  bool present = false;       ///< the head had a frame in the set: its time and settings are known
  std::string placeholder{};  ///< why there is no picture: "missing", "format"; empty: there is one
  ImageView image{};          ///< refers to the TakeSet; without data if it was not read
  Fields fields = Fields::kProgressive;
  Duration offset{};  ///< its mid-exposure after the set's
  Exposure exposure{};
  Gain gain{};
  WhiteBalance white_balance{};
  std::int32_t gamma = 0;  ///< thousandths; 0: the head's own curve
  std::uint32_t sequence = 0;
};

/// One set, with a frame for each head of the take. A head that has no file in the segment is not there.
struct TakeSet {
  take::wire::Set evidence;  ///< without its frames
  Instant mid_exposure;
  std::array<TakeFrame, kMaxHeads> heads{};
  std::array<std::vector<std::uint8_t>, kMaxHeads> bytes{};
};

/// All sets of a take, one after the other. Those that were deleted are left out; the others keep their index.
///
/// Threading: thread-bound.
/// Ownership: refers to the folder; has one segment in memory.
/// Errors: those of TakeFolder.
class TakeSets {
 public:
  explicit TakeSets(const TakeFolder& folder) : folder_(folder) {}
  /// The next set, without pictures; false after the last.
  Result<bool> next(TakeSet& set);
  /// From the first set on again.
  void restart() { segment_.reset(), next_segment_ = next_set_ = 0; }
  /// A set in the take.
  struct Place {
    std::size_t segment = 0, set = 0;
    SetsBefore before{};  ///< the segment
  };
  /// Of the set that next() gave last.
  Place place() const { return {next_segment_ - 1, next_set_ - 1, segment_->before()}; }
  /// From a set on that place() said. Fast within one segment; otherwise it opens the other one.
  Status go_to(const Place& place);
  /// Reads the pictures of the set that next() gave last.
  Status read_pictures(TakeSet& set);
  /// The same of one head; one without a picture in the set is left as it is.
  Status read_picture(TakeSet& set, std::size_t head);
  /// The segment of that set.
  TakeSegment& segment() { return *segment_; }

 private:
  const TakeFolder& folder_;
  std::optional<TakeSegment> segment_;
  std::size_t next_segment_ = 0;
  std::size_t next_set_ = 0;  ///< index in the segment
};

}  // namespace nodal::media
