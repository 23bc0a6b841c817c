#include "host_tool/input/project_pictures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <system_error>

#include "protocol/base/text.h"
#include "protocol/base/try.h"

namespace nodal::host {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kLongestName = 200;  // bytes of a picture's name, in a message

/// With all links followed, as far as the file exists.
bool is_beneath(const fs::path& folder, const fs::path& file) {
  std::error_code error;
  const fs::path from = fs::current_path(error);
  if (error) return false;
  const fs::path inside = fs::weakly_canonical(from / folder, error);
  if (error) return false;
  const fs::path whole = fs::weakly_canonical(from / file, error);
  if (error) return false;
  const auto [rest, end] = std::mismatch(inside.begin(), inside.end(), whole.begin(), whole.end());
  return rest == inside.end();
}

/// The parts of a path of any system: C:\a\b.jpg, /a/b.jpg, a/b.jpg.
std::vector<std::string> parts_of(const std::string& path) {
  std::vector<std::string> parts;
  std::string part;
  for (const char c : path + "/") {
    if (c != '/' && c != '\\') {
      part += c;
      continue;
    }
    if (part == "..") parts.clear();
    if (!part.empty() && part != "." && part != "..") parts.push_back(part);
    part.clear();
  }
  return parts;
}

bool same_but_case(std::string_view a, std::string_view b) {
  return std::ranges::equal(a, b, [](unsigned char x, unsigned char y) { return std::tolower(x) == std::tolower(y); });
}

/// The entry of a folder with this name, or else one that differs in case only; empty if there is none.
fs::path entry_of(const fs::path& folder, const std::string& name) {
  std::error_code error;
  if (fs::exists(folder / name, error)) return folder / name;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    if (same_but_case(entry.path().filename().string(), name)) return entry.path();
  }
  return {};
}

/// The file below `folder` that has most of the last parts of `image`'s path; empty if there is none.
fs::path beside(const fs::path& folder, const std::string& image) {
  constexpr std::size_t kMaxParts = 4;  // the name and the folders above it
  const std::vector<std::string> parts = parts_of(image);
  for (std::size_t count = std::min(parts.size(), kMaxParts); count > 0; --count) {
    fs::path at = folder;
    for (std::size_t k = parts.size() - count; k < parts.size() && !at.empty(); ++k) at = entry_of(at, parts[k]);
    std::error_code error;
    if (!at.empty() && fs::is_regular_file(at, error) && is_beneath(folder, at)) return at.lexically_normal();
  }
  return {};
}

}  // namespace

Result<ProjectPicture> project_picture(const std::string& project, const std::string& image, PicturePlaces places) {
  const fs::path parent = fs::path(project).parent_path();
  const fs::path folder = parent.empty() ? "." : parent;
  const fs::path file = (parent / image).lexically_normal();
  const bool allowed = places == PicturePlaces::kAnywhere || is_beneath(folder, file);
  std::error_code error;
  if (allowed && fs::exists(file, error)) return ProjectPicture{file.string()};
  if (const fs::path found = beside(folder, image); !found.empty()) {
    return ProjectPicture{parent.empty() ? found.lexically_relative(".").string() : found.string(), true};
  }
  if (allowed) return ProjectPicture{file.string()};
  return fail(
      Errc::kBadValue,
      fmt::format("{}: names the picture '{}', which is outside the project's folder and not beside the project; "
                  "copy it there, name the pictures on the command line, or allow it with {}",
                  project, printable(image, kLongestName), kPicturesAnywhere));
}

Result<FoundPictures> project_pictures(const std::string& project, const std::vector<std::string>& images,
                                       PicturePlaces places) {
  FoundPictures pictures;
  std::size_t moved = 0;
  std::string first;
  for (const std::string& image : images) {
    NODAL_TRY_ASSIGN(ProjectPicture picture, project_picture(project, image, places));
    if (picture.moved && moved++ == 0) {
      first = fmt::format("'{}' is {}", printable(image, kLongestName), printable(picture.file, kLongestName));
    }
    pictures.files.push_back(std::move(picture.file));
  }
  if (moved > 0) {
    pictures.notes.push_back(
        fmt::format("{} of {} pictures are not where the project says, and were found beside it: {}{}", moved,
                    images.size(), first, moved > 1 ? ", and so on" : ""));
  }
  return pictures;
}

}  // namespace nodal::host
