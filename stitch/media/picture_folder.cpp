#include "stitch/media/picture_folder.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "protocol/base/file_ending.h"
#include "protocol/base/text.h"
#include "protocol/files/open_file.h"
#include "stitch/media/image_file.h"

namespace nodal::media {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view kMaskEnding = ".mask.png";

/// Files that are left out, by their kind.
class LeftOut {
 public:
  void add(std::string_view one, std::string_view many, std::string_view advice, const std::string& file) {
    Kind& kind = kinds_[{std::string(one), std::string(advice)}];
    kind.many = many;
    kind.files.push_back(printable(fs::path(file).filename().string(), kMaxName));
  }

  /// "2 HEIF files (a.heic, b.heic): convert them ...; an empty file (c.jpg): ...".
  std::string text() const {
    constexpr std::size_t kMaxNames = 3;
    std::string all;
    for (const auto& [named, kind] : kinds_) {
      const auto& [one, advice] = named;
      std::vector<std::string> names = kind.files;
      std::ranges::sort(names);
      std::string listed;
      for (std::size_t k = 0; k < std::min(names.size(), kMaxNames); ++k) listed += (k > 0 ? ", " : "") + names[k];
      if (names.size() > kMaxNames) listed += fmt::format(" and {} more", names.size() - kMaxNames);
      all += fmt::format("{}{} ({}){}{}", all.empty() ? "" : "; ",
                         names.size() == 1 ? one : fmt::format("{} {}", names.size(), kind.many), listed,
                         advice.empty() ? "" : ": ", advice);
    }
    return all;
  }

 private:
  static constexpr std::size_t kMaxName = 100;  // bytes
  struct Kind {
    std::string many;
    std::vector<std::string> files;
  };
  std::map<std::pair<std::string, std::string>, Kind> kinds_;  ///< by its name and advice
};

/// What the first bytes of a file say.
struct Looked {
  const FileKind* kind = nullptr;
  bool tiff = false;
};

Looked look_at(const fs::path& file) {
  const Result<FilePtr> in = open_to_read(file);
  if (!in) return {};
  std::vector<std::uint8_t> head(kFileKindBytes);
  head.resize(std::fread(head.data(), 1, head.size(), in->get()));
  return {file_kind(head, file.string()), begins_like_tiff(head)};
}

/// The message of a reader without the name of the file.
std::string why(const Error& error, const std::string& file) {
  const std::string name = "picture '" + file + "': ";
  return error.message.starts_with(name) ? error.message.substr(name.size()) : error.message;
}

}  // namespace

Result<PictureFolder> pictures_in(const fs::path& folder, const HeaderReader& header, bool tiff) {
  PictureFolder pictures;
  LeftOut left_out;
  std::vector<std::string> masks;
  std::error_code error;
  fs::directory_iterator entries(folder, error);
  for (; !error && entries != fs::directory_iterator(); entries.increment(error)) {
    const std::string file = entries->path().string();
    if (entries->path().filename().string().starts_with('.')) continue;
    std::error_code unknown;
    if (entries->is_directory(unknown)) {
      left_out.add("a folder", "folders", "give it by its own name", file);
    } else if (!entries->is_regular_file(unknown)) {
      left_out.add("no regular file", "that are no regular files", "", file);
    } else if (is_mask_name(file)) {
      masks.push_back(file);
    } else if (const Result<ImageHeader> its = header(file)) {
      pictures.files.push_back(file);
    } else {
      Looked looked = look_at(file);
      const bool by_hosts = looked.kind != nullptr && looked.kind->read_by_hosts;
      if (named_like_a_picture(file) && (tiff || !by_hosts)) pictures.broken.push_back(file);
      if (tiff && by_hosts) looked.kind = nullptr;  // a broken one
      if (looked.kind != nullptr) {
        left_out.add(looked.kind->one, looked.kind->many, looked.kind->advice, file);
      } else if (looked.tiff && !tiff) {
        left_out.add("a TIFF", "TIFFs", "convert it to PNG (convert FILE.tif FILE.png)", file);
      } else if (its.error().code == Errc::kUnsupported) {
        left_out.add("a picture that is not read", "pictures that are not read", why(its.error(), file), file);
      } else {
        left_out.add("a broken picture", "broken pictures", "copy it from the camera again", file);
      }
    }
  }
  if (error) return fail(Errc::kIo, folder.string() + ": the folder cannot be read: " + error.message());
  for (const std::string& mask : masks) {
    const std::string stem = mask.substr(0, mask.size() - kMaskEnding.size());
    const auto its = [&](const std::string& file) { return fs::path(file).replace_extension().string() == stem; };
    if (std::ranges::any_of(pictures.files, its)) continue;
    left_out.add("a mask without its picture", "masks without their pictures", "a.mask.png is the mask of a.jpg", mask);
  }
  if (pictures.files.empty()) {
    const std::string others = left_out.text();
    return fail(
        Errc::kNotFound,
        folder.string() + ": there is no picture in this folder" +
            (others.empty() ? ""
                            : " that is read (" + std::string(tiff ? "JPEG, PNG, TIFF, HEIF, WebP" : "JPEG, PNG") +
                                  "); it holds " + others));
  }
  std::ranges::sort(pictures.files);
  std::ranges::sort(pictures.broken);
  if (const std::string others = left_out.text(); !others.empty()) {
    pictures.left_out =
        fmt::format("{}: {} pictures are read; left out: {}", folder.string(), pictures.files.size(), others);
  }
  return pictures;
}

Result<PictureFolder> jpegs_and_pngs_in(const fs::path& folder) {
  return pictures_in(folder, read_image_header, false);
}

bool is_mask_name(std::string_view file) {
  return has_ending(file, kMaskEnding) && fs::path(file).filename().string().size() > kMaskEnding.size();
}

bool named_like_a_picture(std::string_view file) {
  constexpr std::array<std::string_view, 9> kEndings{".jpg",  ".jpeg", ".png", ".tif", ".tiff",
                                                     ".heic", ".heif", ".hif", ".webp"};
  return std::ranges::any_of(kEndings, [&](std::string_view ending) { return has_ending(file, ending); });
}

const FileKind* kind_of_file(const fs::path& file) { return look_at(file).kind; }

}  // namespace nodal::media
