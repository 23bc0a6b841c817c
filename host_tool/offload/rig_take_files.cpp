#include "host_tool/offload/rig_take_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include "host_tool/offload/take_fetch.h"
#include "protocol/base/file_ending.h"
#include "protocol/base/try.h"
#include "protocol/take/digest.h"
#include "protocol/take/documents.h"
#include "protocol/take/evidence.h"

namespace nodal::host {
namespace {

using Bytes = std::vector<std::uint8_t>;
constexpr std::uint64_t kWindow = 8 * take::PieceHashes::kPiece;

/// What all files of the take share.
struct Source {
  std::unique_ptr<RigConnection> rig;
  std::uint64_t take = 0;
  std::map<std::string, std::uint64_t> sizes;  ///< by the manifest
  std::string shown(const std::string& name) const {
    return fmt::format("take {} on {}{}{}", take, rig->address(), name.empty() ? "" : ": ", name);
  }
};

class Fetched final : public media::TakeFile {
 public:
  explicit Fetched(Bytes bytes, std::string shown) : bytes_(std::move(bytes)), shown_(std::move(shown)) {}
  std::uint64_t size() const override { return bytes_.size(); }
  Status read(std::uint64_t at, std::span<std::uint8_t> bytes) override {
    if (at > bytes_.size() || bytes.size() > bytes_.size() - at)
      return fail(Errc::kTruncated, fmt::format("{}: ends at byte {}", shown_, bytes_.size()));
    std::copy_n(bytes_.begin() + static_cast<std::ptrdiff_t>(at), bytes.size(), bytes.begin());
    return {};
  }

 private:
  const Bytes bytes_;
  const std::string shown_;
};

/// A window of a file, which moves to where it is read.
class Video final : public media::TakeFile {
 public:
  Video(std::shared_ptr<Source> source, std::string name, std::uint64_t size)
      : source_(std::move(source)), name_(std::move(name)), size_(size) {}
  std::uint64_t size() const override { return size_; }
  Status read(std::uint64_t at, std::span<std::uint8_t> bytes) override {
    if (at > size_ || bytes.size() > size_ - at)
      return fail(Errc::kTruncated, fmt::format("{}: ends at byte {}", source_->shown(name_), size_));
    while (!bytes.empty()) {
      if (at < from_ || at >= from_ + window_.size()) {
        NODAL_TRY(fetch(at));
        if (window_.size() <= at - from_)
          return fail(Errc::kTruncated,
                      fmt::format("{}: ends at byte {}", source_->shown(name_), from_ + window_.size()));
      }
      const std::size_t skip = static_cast<std::size_t>(at - from_);
      const std::size_t part = std::min(bytes.size(), window_.size() - skip);
      std::copy_n(window_.begin() + static_cast<std::ptrdiff_t>(skip), part, bytes.begin());
      bytes = bytes.subspan(part);
      at += part;
    }
    return {};
  }

 private:
  Status fetch(std::uint64_t at) {
    from_ = at / take::PieceHashes::kPiece * take::PieceHashes::kPiece;
    window_.clear();
    bool full = false;
    const OnPiece keep = [&](std::uint64_t, std::span<const std::uint8_t> piece) -> Status {
      if (piece.size() > size_ - from_ - window_.size()) {
        return fail(Errc::kProtocol,
                    fmt::format("{}: the rig sends more than the manifest says", source_->shown(name_)));
      }
      window_.insert(window_.end(), piece.begin(), piece.end());
      full = window_.size() >= kWindow && from_ + window_.size() < size_;
      return full ? fail(Errc::kCancelled, "enough") : Status();
    };
    const Status fetched = fetch_file(*source_->rig, source_->take, name_, from_, keep);
    return full ? Status() : fetched;
  }

  const std::shared_ptr<Source> source_;
  const std::string name_;
  const std::uint64_t size_;
  std::uint64_t from_ = 0;  ///< position of the window in the file, bytes
  Bytes window_;
};

class RigTakeFiles final : public media::TakeFiles {
 public:
  RigTakeFiles(std::unique_ptr<RigConnection> rig, std::uint64_t take) : source_(std::make_shared<Source>()) {
    source_->rig = std::move(rig);
    source_->take = take;
  }

  Result<std::unique_ptr<media::TakeFile>> open(const std::string& name) override {
    if (has_ending(name, ".mkv")) {
      const auto size = source_->sizes.find(name);
      if (size == source_->sizes.end()) return fail(Errc::kNotFound, shown(name) + ": the manifest does not list it");
      return std::make_unique<Video>(source_, name, size->second);
    }
    NODAL_TRY_ASSIGN(auto bytes, fetch_small_file(*source_->rig, source_->take, name, take::kMaxEvidenceBytes));
    if (name == take::kManifestFile) {
      NODAL_TRY_ASSIGN(const auto manifest,
                       take::parse_manifest({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, shown(name)));
      for (const take::Manifest::File& file : manifest.files) source_->sizes[file.name] = file.bytes;
    }
    return std::make_unique<Fetched>(std::move(bytes), shown(name));
  }
  std::string shown(const std::string& name) const override { return source_->shown(name); }

 private:
  const std::shared_ptr<Source> source_;
};

}  // namespace

std::shared_ptr<media::TakeFiles> rig_take_files(std::unique_ptr<RigConnection> rig, std::uint64_t take) {
  return std::make_shared<RigTakeFiles>(std::move(rig), take);
}

}  // namespace nodal::host
