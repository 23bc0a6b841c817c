#include "host_tool/input/pictures.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>
#include <string_view>
#include <utility>

#include "stitch/media/image_file.h"
#include "stitch/media/tiff/tiff_reader.h"
#include "stitch/parallel/workers.h"

namespace nodal::host {

namespace fs = std::filesystem;

Result<DecodedImage> read_picture(const std::string& file, std::optional<PixelFormat> as) {
  if (!media::is_tiff(file)) return media::read_image(file, as);
  Result<DecodedImage> picture = media::read_tiff(file);
  if (!picture || !as || picture->format == *as) return picture;
  return media::convert_image(picture->view(), *as);
}

Result<std::vector<DecodedImage>> read_all(const std::vector<std::string>& files,
                                           const std::function<void(std::size_t n)>& begin) {
  const parallel::Workers workers(0);
  std::vector<DecodedImage> images;
  while (images.size() < files.size()) {
    begin(images.size());
    const std::size_t at_once = std::min(files.size() - images.size(), static_cast<std::size_t>(workers.threads()));
    std::vector<std::optional<Result<DecodedImage>>> read(at_once);
    workers.run(static_cast<int>(at_once), [&](int i) {
      const auto k = static_cast<std::size_t>(i);
      read[k] = read_picture(files[images.size() + k]);
    });
    for (std::optional<Result<DecodedImage>>& one : read) {
      if (!*one) return fail(one->error());
      images.push_back(std::move(**one));
    }
  }
  return images;
}

Result<ImageHeader> read_picture_header(const std::string& file) {
  return media::is_tiff(file) ? media::read_tiff_header(file) : media::read_image_header(file);
}

Result<std::vector<std::string>> pictures_in(const std::string& folder) {
  std::vector<std::string> found;
  std::error_code error;
  fs::directory_iterator entries(folder, error);
  for (; !error && entries != fs::directory_iterator(); entries.increment(error)) {
    std::error_code unknown;
    if (entries->is_regular_file(unknown) && read_picture_header(entries->path().string())) {
      found.push_back(entries->path().string());
    }
  }
  if (error) return fail(Errc::kIo, folder + ": the folder cannot be read: " + error.message());
  if (found.empty()) return fail(Errc::kNotFound, folder + ": there is no picture in this folder");
  std::ranges::sort(found);
  return found;
}

bool named_like_a_picture(const std::string& file) {
  std::string ending = fs::path(file).extension().string();
  std::ranges::transform(ending, ending.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  constexpr std::array<std::string_view, 5> kEndings{".jpg", ".jpeg", ".png", ".tif", ".tiff"};
  return std::ranges::find(kEndings, ending) != kEndings.end();
}

}  // namespace nodal::host
