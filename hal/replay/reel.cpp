#include "hal/replay/reel.h"

#include <glob.h>

#include <algorithm>
#include <cctype>
#include <vector>

namespace nodal::hal::replay {

namespace {

namespace fs = std::filesystem;

bool is_picture_name(const fs::path& file) {
  std::string ending = file.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(), [](unsigned char c) { return std::tolower(c); });
  return ending == ".jpg" || ending == ".jpeg" || ending == ".png";
}

std::vector<fs::path> files_at(const fs::path& where) {
  std::vector<fs::path> files;
  std::error_code error;
  if (fs::is_directory(where, error)) {
    for (fs::directory_iterator it(where, error), end; !error && it != end; it.increment(error)) {
      if (is_picture_name(it->path())) files.push_back(it->path());
    }
  } else if (fs::exists(where, error)) {
    files.push_back(where);
  } else {
    glob_t found{};
    if (::glob(where.c_str(), 0, nullptr, &found) == 0) files.assign(found.gl_pathv, found.gl_pathv + found.gl_pathc);
    ::globfree(&found);
  }
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
  Shot shot(std::size_t i) override { return {true, picture(i), {}}; }

 private:
  std::shared_ptr<const DecodedImage> picture(std::size_t i);

  PictureReader reader_;
  std::vector<fs::path> files_;
  std::vector<std::shared_ptr<const DecodedImage>> kept_;
  std::size_t may_keep_ = 0;  ///< limit in pictures
  std::size_t keeps_ = 0;
  PixelFormat format_ = PixelFormat::kRgb24;
  int width_ = 0;
  int height_ = 0;
};

Result<std::unique_ptr<Reel>> PictureReel::open(const fs::path& where, std::optional<PixelFormat> as,
                                                std::uint64_t keep_bytes, const PictureReader& reader) {
  auto made = std::make_unique<PictureReel>();
  PictureReel& reel = *made;
  reel.reader_ = reader;
  reel.files_ = files_at(where);
  if (reel.files_.empty()) {
    return fail(Errc::kNoSuchDevice, "replay '" + where.string() + "': no JPEG or PNG is there");
  }
  const auto first = reader.header(reel.files_.front());
  if (!first) return fail(first.error());
  reel.format_ = as.value_or(first->natural);
  reel.width_ = first->width;
  reel.height_ = first->height;
  for (const fs::path& file : reel.files_) {
    const auto header = reader.header(file);
    if (!header) return fail(header.error());
    if (header->width != reel.width_ || header->height != reel.height_) {
      return fail(Errc::kBadValue, "picture '" + file.string() + "': is " + std::to_string(header->width) + "x" +
                                       std::to_string(header->height) + ", but the head's first is " +
                                       std::to_string(reel.width_) + "x" + std::to_string(reel.height_));
    }
  }
  reel.kept_.resize(reel.files_.size());
  auto image = reader.read(reel.files_.front(), reel.format_);
  if (!image) return fail(image.error());
  // The JPEGs of a film differ little in size.
  reel.may_keep_ = std::max<std::size_t>(1, static_cast<std::size_t>(keep_bytes) / image->bytes.size());
  reel.kept_.front() = std::make_shared<const DecodedImage>(std::move(*image));
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

bool pictures_present(const fs::path& where) { return !files_at(where).empty(); }

Result<std::unique_ptr<Reel>> open_pictures(const fs::path& where, std::optional<PixelFormat> as,
                                            std::uint64_t keep_bytes, const PictureReader& reader) {
  return PictureReel::open(where, as, keep_bytes, reader);
}

}  // namespace nodal::hal::replay
