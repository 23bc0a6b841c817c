#include "host_tool/input/project_pictures.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <system_error>

#include "protocol/base/text.h"

namespace nodal::host {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kLongestName = 200;  // bytes of a picture's name, in a message

/// With all links followed, as far as the file exists.
bool is_beneath(const fs::path& folder, const fs::path& file) {
  std::error_code error;
  const fs::path inside = fs::weakly_canonical(fs::absolute(folder), error);
  if (error) return false;
  const fs::path whole = fs::weakly_canonical(fs::absolute(file), error);
  if (error) return false;
  const auto [rest, from] = std::mismatch(inside.begin(), inside.end(), whole.begin(), whole.end());
  return rest == inside.end();
}

}  // namespace

Result<std::string> project_picture(const std::string& project, const std::string& image, PicturePlaces places) {
  const fs::path folder = fs::path(project).parent_path();
  const fs::path file = (folder / image).lexically_normal();
  if (places == PicturePlaces::kAnywhere || is_beneath(folder.empty() ? "." : folder, file)) return file.string();
  return fail(Errc::kBadValue,
              fmt::format("{}: names the picture '{}', which is outside the project's folder; copy it there, name the "
                          "pictures on the command line, or allow it with {}",
                          project, printable(image, kLongestName), kPicturesAnywhere));
}

Result<std::vector<std::string>> project_pictures(const std::string& project, const std::vector<std::string>& images,
                                                  PicturePlaces places) {
  std::vector<std::string> files;
  for (const std::string& image : images) {
    Result<std::string> file = project_picture(project, image, places);
    if (!file) return fail(file.error());
    files.push_back(std::move(*file));
  }
  return files;
}

}  // namespace nodal::host
