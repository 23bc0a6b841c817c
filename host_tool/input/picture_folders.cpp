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
#include "protocol/base/try.h"
#include "protocol/files/open_file.h"
#include "stitch/media/heif_webp/reader.h"
#include "stitch/media/picture_bytes.h"
#include "stitch/media/picture_folder.h"
#include "stitch/media/xmp/xmp.h"

namespace nodal::host {

namespace fs = std::filesystem;

namespace {

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

}  // namespace

Result<ImageHeader> OpenPictures::header_of(const std::string& file) {
  if (const auto found = files_.find(file); found != files_.end()) return read_picture_header(*found->second);
  NODAL_TRY_ASSIGN(media::PictureBytes bytes, media::PictureBytes::open(file));
  NODAL_TRY_ASSIGN(ImageHeader header, read_picture_header(bytes));
  if (files_.size() < kMaxOpen) files_.emplace(file, std::make_shared<media::PictureBytes>(std::move(bytes)));
  return header;
}

int OpenPictures::count_pictures(const std::string& file) const {
  const auto found = files_.find(file);
  return found == files_.end() ? 1 : media::count_pictures(*found->second);
}

std::shared_ptr<media::PictureBytes> OpenPictures::take(const std::string& file) {
  auto found = files_.extract(file);
  return found ? std::move(found.mapped()) : nullptr;
}

bool is_sphere(const ImageHeader& picture) {
  return !picture.metadata.xmp.empty() && media::parse_xmp(picture.metadata.xmp).area.has_value();
}

Result<PictureFolder> head_pictures_in(const std::string& folder, OpenPictures& opened) {
  std::vector<std::string> spheres;
  Result<PictureFolder> pictures = media::pictures_in(
      folder,
      [&](const fs::path& file) {
        Result<ImageHeader> header = opened.header_of(file.string());
        if (header && is_sphere(*header)) spheres.push_back(file.string());
        return header;
      },
      true);
  if (!pictures || spheres.empty()) return pictures;
  std::ranges::sort(spheres);
  for (const std::string& sphere : spheres) opened.take(sphere);
  std::erase_if(pictures->files, [&](const std::string& file) { return std::ranges::binary_search(spheres, file); });
  const std::string named = spheres.size() == 1 ? "a sphere (" + fs::path(spheres.front()).filename().string() + ")"
                                                : fmt::format("{} spheres ({} and others)", spheres.size(),
                                                              fs::path(spheres.front()).filename().string());
  if (pictures->files.empty()) {
    return fail(Errc::kNotFound, folder + ": there is no head's picture in this folder; it holds " + named);
  }
  // The spheres were counted among the pictures that are read.
  const auto read = [&](std::size_t count) {
    return fmt::format("{}: {} pictures are read; left out: ", folder, count);
  };
  const std::string counted = read(pictures->files.size() + spheres.size());
  const std::string others =
      pictures->left_out.starts_with(counted) ? pictures->left_out.substr(counted.size()) + "; " : "";
  pictures->left_out =
      fmt::format("{}{}{}, made by an earlier run and no head's picture", read(pictures->files.size()), others, named);
  return pictures;
}

Result<PictureFolder> pictures_in(const std::string& folder) {
  return media::pictures_in(
      folder, [](const fs::path& file) { return OpenPictures().header_of(file.string()); }, true);
}

Result<PictureFolder> sequence_in(const std::string& folder) {
  Result<PictureFolder> pictures = pictures_in(folder);
  if (!pictures || pictures->broken.empty()) return pictures;
  const Result<ImageHeader> header = OpenPictures().header_of(pictures->broken.front());
  const std::string why = header ? "it changed while it was read" : header.error().message;
  return fail(Errc::kBadFormat,
              why + "; in a sequence every picture counts: replace it, or take its set out of all folders");
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
