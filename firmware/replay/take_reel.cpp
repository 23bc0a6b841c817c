#include "firmware/replay/take_reel.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "protocol/base/try.h"
#include "stitch/media/take/take_folder.h"

namespace nodal::firmware {
namespace {

class FileOnDisk final : public media::TakeFile {
 public:
  FileOnDisk(hal::DiskPort& disk, hal::FileHandle file, std::uint64_t size, std::string shown)
      : disk_(disk), file_(file), size_(size), shown_(std::move(shown)) {}
  FileOnDisk(const FileOnDisk&) = delete;
  FileOnDisk& operator=(const FileOnDisk&) = delete;
  ~FileOnDisk() override { disk_.close(file_); }

  std::uint64_t size() const override { return size_; }
  Status read(std::uint64_t at, std::span<std::uint8_t> bytes) override {
    NODAL_TRY_ASSIGN(const auto got, disk_.read_at(file_, at, bytes));
    if (got < bytes.size()) return fail(Errc::kTruncated, fmt::format("{}: ends at byte {}", shown_, at + got));
    return {};
  }

 private:
  hal::DiskPort& disk_;
  hal::FileHandle file_;
  std::uint64_t size_;
  std::string shown_;
};

class FolderOnDisk final : public media::TakeFiles {
 public:
  FolderOnDisk(std::unique_ptr<hal::DiskPort> disk, const std::string& folder, std::string shown)
      : disk_(std::move(disk)), prefix_(folder.empty() ? "" : folder + "/"), shown_(std::move(shown)) {}

  Result<std::unique_ptr<media::TakeFile>> open(const std::string& name) override {
    NODAL_TRY_ASSIGN(const auto file, disk_->open_read(prefix_ + name));
    const auto size = disk_->size(prefix_ + name);
    if (!size) {
      disk_->close(file);
      return fail(size.error());
    }
    return std::make_unique<FileOnDisk>(*disk_, file, *size, shown(name));
  }
  std::string shown(const std::string& name) const override { return name.empty() ? shown_ : shown_ + "/" + name; }

 private:
  std::unique_ptr<hal::DiskPort> disk_;
  std::string prefix_;
  std::string shown_;
};

class TakeReel final : public hal::replay::Reel {
 public:
  TakeReel(media::TakeFolder folder, std::size_t head) : folder_(std::move(folder)), head_(head) {}

  /// Finds the head's format: that of the first segment with pictures of it.
  Status find_stream() {
    media::SetsBefore before;
    for (std::size_t k = 0; k < folder_.segments(); ++k) {
      NODAL_TRY_ASSIGN(const auto segment, folder_.segment(k, before));
      before = segment.after();
      for (const take::StreamFile& file : segment.streams()) {
        if (file.head != head_) continue;
        stream_ = file.stream;
        return {};
      }
    }
    return fail(Errc::kNoSuchDevice,
                folder_.shown("") + ": has no picture of head '" + folder_.about().heads[head_] + "'");
  }

  std::size_t size() const override { return static_cast<std::size_t>(folder_.manifest().sets); }
  PixelFormat format() const override { return stream_.format; }
  int width() const override { return stream_.width; }
  int height() const override { return stream_.height; }
  ColourCoding coding() const override { return stream_.coding; }
  std::optional<Fields> fields() const override { return stream_.fields; }
  std::optional<FrameRate> rate() const override { return folder_.about().rate; }

  hal::replay::Shot shot(std::size_t i) override {
    if (i >= broken_from_) return {};
    const auto found = go_to(i);
    if (!found || !*found) {
      broken_from_ = i;  // reading all sets before it again for each frame would hold up the other heads
      sets_.reset();
      return {};  // a frame that cannot be read
    }
    const media::TakeFrame& frame = set_.heads[head_];
    hal::replay::Shot shot{frame.present, nullptr, {}};
    if (!frame.present) return shot;
    shot.in_effect = {frame.exposure, frame.gain, frame.white_balance, hal::Gamma::thousandths(frame.gamma)};
    if (!sets_->read_picture(set_, head_)) return shot;
    const ImageView& image = set_.heads[head_].image;
    const bool same = image.format == stream_.format && image.width == stream_.width && image.height == stream_.height;
    if (!frame.placeholder.empty() || !same) return shot;
    auto picture = std::make_shared<DecodedImage>();
    picture->format = image.format;
    picture->width = image.width;
    picture->height = image.height;
    picture->bytes.swap(set_.bytes[head_]);
    shot.picture = std::move(picture);
    return shot;
  }

 private:
  /// Sets are read one after the other; going back means to begin again.
  Result<bool> go_to(std::size_t i) {
    if (!sets_ || i < at_) {
      sets_.emplace(folder_);
      at_ = 0;
      const auto first = sets_->next(set_);
      if (!first || !*first) return first;
    }
    for (; at_ < i; ++at_) {
      const auto next = sets_->next(set_);
      if (!next || !*next) return next;
    }
    return true;
  }

  const media::TakeFolder folder_;
  const std::size_t head_;
  take::Stream stream_;
  std::optional<media::TakeSets> sets_;
  media::TakeSet set_;
  std::size_t at_ = 0;                  ///< the set that set_ is
  std::size_t broken_from_ = SIZE_MAX;  ///< sets from this one on cannot be read
};

}  // namespace

Result<std::unique_ptr<hal::replay::Reel>> open_take_reel(std::unique_ptr<hal::DiskPort> disk,
                                                          const std::string& folder_name, const std::string& shown,
                                                          const std::string& head) {
  NODAL_TRY_ASSIGN(auto folder,
                   media::TakeFolder::open(std::make_shared<FolderOnDisk>(std::move(disk), folder_name, shown)));
  const std::vector<std::string>& heads = folder.about().heads;
  const auto found = std::ranges::find(heads, head);
  if (found == heads.end()) {
    std::string names;
    for (const std::string& name : heads) names += (names.empty() ? "" : ", ") + name;
    return fail(Errc::kNoSuchDevice, shown + ": the take has no head '" + head + "'; it has " + names);
  }
  if (folder.manifest().sets == 0) return fail(Errc::kNoSuchDevice, shown + ": the take has no set");
  auto reel = std::make_unique<TakeReel>(std::move(folder), static_cast<std::size_t>(found - heads.begin()));
  NODAL_TRY(reel->find_stream());
  return reel;
}

}  // namespace nodal::firmware
