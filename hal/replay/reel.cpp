#include "hal/replay/reel.h"

#include <fmt/format.h>

#include <glob.h>

#include <algorithm>
#include <vector>

#include "protocol/base/try.h"

namespace nodal::hal::replay {

namespace {

namespace fs = std::filesystem;

/// The files of a glob(7) pattern; or the file itself.
std::vector<fs::path> files_of_pattern(const fs::path& where) {
  std::vector<fs::path> files;
  std::error_code error;
  if (fs::exists(where, error)) return {where};
  glob_t found{};
  if (::glob(where.c_str(), 0, nullptr, &found) == 0) files.assign(found.gl_pathv, found.gl_pathv + found.gl_pathc);
  ::globfree(&found);
  std::sort(files.begin(), files.end());
  return files;
}

class PictureReel final : public Reel {
 public:
  static Result<std::unique_ptr<Reel>> open(const fs::path& where, std::optional<PixelFormat> as,
                                            std::uint64_t keep_bytes, const PictureReader& reader);

  std::size_t size() const override { return files_.size(); }
  PixelFormat format() const override { return format_; }
  int width() const override { return width_; }
  int height() const override { return height_; }
  std::string left_out() const override { return left_out_; }
  Shot shot(std::size_t i) override { return {true, picture(i), {}}; }

 private:
  Status find_files(const fs::path& where);
  std::shared_ptr<const DecodedImage> picture(std::size_t i);

  PictureReader reader_;
  std::vector<fs::path> files_;
  std::string left_out_;
  std::vector<std::shared_ptr<const DecodedImage>> kept_;
  std::size_t may_keep_ = 0;  ///< limit in pictures
  std::size_t keeps_ = 0;
  PixelFormat format_ = PixelFormat::kRgb24;
  int width_ = 0;
  int height_ = 0;
};

Status PictureReel::find_files(const fs::path& where) {
  const std::string named = "replay '" + where.string() + "': ";
  std::error_code error;
  if (!fs::is_directory(where, error)) {
    files_ = files_of_pattern(where);
    if (files_.empty()) return fail(Errc::kNoSuchDevice, named + "no file is there");
    return {};
  }
  const Result<PictureFolder> found = reader_.folder(where);
  if (!found && found.error().code == Errc::kNotFound) return fail(Errc::kNoSuchDevice, found.error().message);
  if (!found) return fail(found.error());
  for (const std::string& broken : found->broken) {
    // Without it, the later pictures of this head would be in other sets than those of the other heads.
    NODAL_TRY(reader_.header(broken));
  }
  files_.assign(found->files.begin(), found->files.end());
  left_out_ = found->left_out;
  return {};
}

Result<std::unique_ptr<Reel>> PictureReel::open(const fs::path& where, std::optional<PixelFormat> as,
                                                std::uint64_t keep_bytes, const PictureReader& reader) {
  auto made = std::make_unique<PictureReel>();
  PictureReel& reel = *made;
  reel.reader_ = reader;
  NODAL_TRY(reel.find_files(where));
  NODAL_TRY_ASSIGN(const auto first, reader.header(reel.files_.front()));
  reel.format_ = as.value_or(first.natural);
  reel.width_ = first.width;
  reel.height_ = first.height;
  for (const fs::path& file : reel.files_) {
    NODAL_TRY_ASSIGN(const auto header, reader.header(file));
    if (header.width != reel.width_ || header.height != reel.height_) {
      return fail(Errc::kBadValue, fmt::format("picture '{}': is {}x{}, but the head's first is {}x{}", file.string(),
                                               header.width, header.height, reel.width_, reel.height_));
    }
  }
  reel.kept_.resize(reel.files_.size());
  NODAL_TRY_ASSIGN(auto image, reader.read(reel.files_.front(), reel.format_));
  // The JPEGs of a film differ little in size.
  reel.may_keep_ = std::max<std::size_t>(1, static_cast<std::size_t>(keep_bytes) / image.bytes.size());
  reel.kept_.front() = std::make_shared<const DecodedImage>(std::move(image));
  reel.keeps_ = 1;
  return made;
}

std::shared_ptr<const DecodedImage> PictureReel::picture(std::size_t i) {
  if (kept_[i]) return kept_[i];
  auto image = reader_.read(files_[i], format_);
  if (!image || image->width != width_ || image->height != height_) return nullptr;
  auto picture = std::make_shared<const DecodedImage>(std::move(*image));
  if (keeps_ < may_keep_) {
    kept_[i] = picture;
    ++keeps_;
  }
  return picture;
}

}  // namespace

bool pictures_present(const fs::path& where) {
  std::error_code error;
  if (!fs::is_directory(where, error)) return !files_of_pattern(where).empty();
  const fs::directory_iterator entries(where, error);
  return !error && std::any_of(begin(entries), end(entries), [](const fs::directory_entry& entry) {
    std::error_code unknown;
    return entry.is_regular_file(unknown);
  });
}

Result<std::unique_ptr<Reel>> open_pictures(const fs::path& where, std::optional<PixelFormat> as,
                                            std::uint64_t keep_bytes, const PictureReader& reader) {
  return PictureReel::open(where, as, keep_bytes, reader);
}

}  // namespace nodal::hal::replay
