#include "host_tool/output/cube_faces.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstring>
#include <filesystem>
#include <optional>

namespace nodal::host {
namespace {

namespace fs = std::filesystem;

/// The face that a file's name ends in.
std::optional<std::size_t> face_of_name(const std::string& file) {
  const std::string stem = fs::path(file).stem().string();
  std::size_t from = stem.size();
  while (from > 0 && std::isalpha(static_cast<unsigned char>(stem[from - 1])) != 0) --from;
  std::string word = stem.substr(from);
  std::ranges::transform(word, word.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (word == "top") word = "up";
  if (word == "bottom") word = "down";
  for (std::size_t face = 0; face < kFaces; ++face) {
    if (word == kFaceNames[face] || word == kFaceNames[face].substr(0, 1)) return face;
  }
  return std::nullopt;
}

std::size_t bytes_of_pixel(const DecodedImage& picture) {
  return picture.bytes.size() / static_cast<std::size_t>(picture.width) / static_cast<std::size_t>(picture.height);
}

}  // namespace

std::string face_file(const std::string& out, std::size_t face) {
  const fs::path path(out);
  return (path.parent_path() /
          fmt::format("{}_{}{}", path.stem().string(), kFaceNames[face], path.extension().string()))
      .string();
}

Result<std::array<std::string, kFaces>> face_files(const std::vector<std::string>& files) {
  if (files.size() != kFaces) {
    return fail(Errc::kBadValue, fmt::format("--from faces: a cube has six files, and {} were given", files.size()));
  }
  std::array<std::string, kFaces> found;
  for (const std::string& file : files) {
    const std::optional<std::size_t> face = face_of_name(file);
    if (!face) {
      return fail(Errc::kBadValue, fmt::format("{}: its name does not end in right, left, up, down, front or back, or "
                                               "the first letter of one",
                                               file));
    }
    if (!found[*face].empty()) {
      return fail(Errc::kBadValue,
                  fmt::format("{} and {} are both the face '{}'", found[*face], file, kFaceNames[*face]));
    }
    found[*face] = file;
  }
  return found;
}

Result<DecodedImage> row_of_faces(const std::array<DecodedImage, kFaces>& faces) {
  const DecodedImage& first = faces[0];
  for (std::size_t face = 0; face < kFaces; ++face) {
    const DecodedImage& each = faces[face];
    if (each.width == first.width && each.height == first.width && each.format == first.format) continue;
    return fail(Errc::kBadValue,
                fmt::format("face '{}' has {}x{} pixels ({}), and face '{}' {}x{} ({}); faces are square and alike",
                            kFaceNames[face], each.width, each.height, pixel_format_name(each.format), kFaceNames[0],
                            first.width, first.height, pixel_format_name(first.format)));
  }
  DecodedImage row{first.format,  static_cast<int>(kFaces) * first.width, first.height, {}, first.meaning,
                   first.metadata};
  const std::size_t line = static_cast<std::size_t>(first.width) * bytes_of_pixel(first);
  row.bytes.resize(kFaces * first.bytes.size());
  for (std::size_t y = 0; y < static_cast<std::size_t>(first.height); ++y) {
    for (std::size_t face = 0; face < kFaces; ++face) {
      std::memcpy(row.bytes.data() + (y * kFaces + face) * line, faces[face].bytes.data() + y * line, line);
    }
  }
  return row;
}

DecodedImage face_of_row(const DecodedImage& row, std::size_t face) {
  DecodedImage one{row.format, row.width / static_cast<int>(kFaces), row.height, {}, row.meaning, row.metadata};
  const std::size_t line = static_cast<std::size_t>(one.width) * bytes_of_pixel(row);
  one.bytes.resize(line * static_cast<std::size_t>(row.height));
  for (std::size_t y = 0; y < static_cast<std::size_t>(row.height); ++y) {
    std::memcpy(one.bytes.data() + y * line, row.bytes.data() + (y * kFaces + face) * line, line);
  }
  return one;
}

}  // namespace nodal::host
