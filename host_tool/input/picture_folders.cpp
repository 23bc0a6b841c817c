#include "host_tool/input/picture_folders.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <map>
#include <numeric>
#include <string_view>

#include "host_tool/input/pictures.h"
#include "protocol/base/file_ending.h"
#include "protocol/base/text.h"
#include "protocol/files/open_file.h"
#include "stitch/media/file_kind.h"

namespace nodal::host {

namespace fs = std::filesystem;

namespace {

/// Files that are left out, by their kind.
class LeftOut {
 public:
  void add(std::string_view one, std::string_view many, std::string_view advice, const std::string& file) {
    Kind& kind = kinds_[std::string(one)];
    kind.many = many;
    kind.advice = advice;
    kind.files.push_back(printable(fs::path(file).filename().string(), kMaxName));
  }

  /// "2 HEIF files (a.heic, b.heic): convert them ...; an empty file (c.jpg): ...".
  std::string text() const {
    constexpr std::size_t kMaxNames = 3;
    std::string all;
    for (const auto& [one, kind] : kinds_) {
      std::vector<std::string> names = kind.files;
      std::ranges::sort(names);
      std::string listed;
      for (std::size_t k = 0; k < std::min(names.size(), kMaxNames); ++k) listed += (k > 0 ? ", " : "") + names[k];
      if (names.size() > kMaxNames) listed += fmt::format(" and {} more", names.size() - kMaxNames);
      all += fmt::format("{}{} ({}){}{}", all.empty() ? "" : "; ",
                         names.size() == 1 ? one : fmt::format("{} {}", names.size(), kind.many), listed,
                         kind.advice.empty() ? "" : ": ", kind.advice);
    }
    return all;
  }

 private:
  static constexpr std::size_t kMaxName = 100;  // bytes
  struct Kind {
    std::string many, advice;
    std::vector<std::string> files;
  };
  std::map<std::string, Kind> kinds_;
};

bool same_bytes(const std::string& a, const std::string& b) {
  const Result<FilePtr> first = open_to_read(a), second = open_to_read(b);
  if (!first || !second) return false;
  std::array<char, 65536> one, two;
  while (true) {
    const std::size_t got = std::fread(one.data(), 1, one.size(), first->get());
    if (std::fread(two.data(), 1, two.size(), second->get()) != got) return false;
    if (got == 0) return std::feof(first->get()) != 0 && std::feof(second->get()) != 0;
    if (!std::equal(one.begin(), one.begin() + static_cast<std::ptrdiff_t>(got), two.begin())) return false;
  }
}

/// Null for a JPEG, a PNG, a TIFF, and for a file that cannot be opened.
const media::FileKind* kind_of_file(const std::string& file) {
  const Result<FilePtr> in = open_to_read(file);
  if (!in) return nullptr;
  std::vector<std::uint8_t> head(media::kFileKindBytes);
  head.resize(std::fread(head.data(), 1, head.size(), in->get()));
  return media::file_kind(head, file);
}

}  // namespace

Result<FolderPictures> pictures_in(const std::string& folder) {
  FolderPictures pictures;
  LeftOut left_out;
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
    } else if (const Result<ImageHeader> header = read_picture_header(file)) {
      pictures.files.push_back(file);
    } else {
      if (named_like_a_picture(file)) pictures.broken.push_back(file);
      const media::FileKind* kind = kind_of_file(file);
      if (kind != nullptr) {
        left_out.add(kind->one, kind->many, kind->advice, file);
      } else {
        left_out.add("a broken picture", "broken pictures", "copy it from the camera again", file);
      }
    }
  }
  if (error) return fail(Errc::kIo, folder + ": the folder cannot be read: " + error.message());
  if (pictures.files.empty()) {
    const std::string others = left_out.text();
    return fail(Errc::kNotFound, folder + ": there is no picture in this folder" +
                                     (others.empty() ? "" : " that is read (JPEG, PNG, TIFF); it holds " + others));
  }
  std::ranges::sort(pictures.files);
  std::ranges::sort(pictures.broken);
  if (const std::string others = left_out.text(); !others.empty()) {
    pictures.left_out = fmt::format("{}: {} pictures are read; left out: {}", folder, pictures.files.size(), others);
  }
  return pictures;
}

Result<FolderPictures> sequence_in(const std::string& folder) {
  Result<FolderPictures> pictures = pictures_in(folder);
  if (!pictures || pictures->broken.empty()) return pictures;
  const Result<ImageHeader> header = read_picture_header(pictures->broken.front());
  const std::string why = header ? "it changed while it was read" : header.error().message;
  return fail(Errc::kBadFormat,
              why + "; in a sequence every picture counts: replace it, or take its set out of all folders");
}

bool named_like_a_picture(const std::string& file) {
  constexpr std::array<std::string_view, 5> kEndings{".jpg", ".jpeg", ".png", ".tif", ".tiff"};
  return std::ranges::any_of(kEndings, [&](std::string_view ending) { return has_ending(file, ending); });
}

bool is_foreign_picture(const std::string& file) {
  std::error_code error;
  if (!fs::is_regular_file(file, error)) return false;
  const media::FileKind* kind = kind_of_file(file);
  return kind != nullptr && kind->pictures;
}

std::vector<std::pair<std::size_t, std::size_t>> same_files(const std::vector<std::string>& files) {
  std::map<std::uintmax_t, std::vector<std::size_t>> by_size;
  std::vector<std::pair<std::size_t, std::size_t>> same;
  // A copy's name is longer: "IMG 1 copy.jpg", "IMG_1 (2).jpg".
  std::vector<std::size_t> order(files.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, {}, [&](std::size_t n) { return files[n].size(); });
  for (const std::size_t n : order) {
    std::error_code unknown;
    const std::uintmax_t size = fs::file_size(files[n], unknown);
    if (unknown) continue;
    std::vector<std::size_t>& earlier = by_size[size];
    const auto found = std::ranges::find_if(earlier, [&](std::size_t e) { return same_bytes(files[e], files[n]); });
    if (found != earlier.end()) {
      same.emplace_back(n, *found);
    } else {
      earlier.push_back(n);
    }
  }
  return same;
}

}  // namespace nodal::host
