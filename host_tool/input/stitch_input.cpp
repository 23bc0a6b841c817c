#include "host_tool/input/stitch_input.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <utility>

#include "host_tool/console/files.h"
#include "host_tool/input/picture_folders.h"
#include "host_tool/input/pictures.h"
#include "protocol/base/try.h"
#include "stitch/interchange/import.h"
#include "stitch/media/image_file.h"

namespace nodal::host {
namespace {

namespace fs = std::filesystem;

struct Project {
  Calibration calibration;
  std::vector<std::string> pictures;  ///< that it names; empty if it does not name one for every head
  std::vector<std::string> notes;
  std::vector<std::string> picture_notes;  ///< of `pictures`
  bool imported = false;
};

Result<Project> read_project(const std::string& file, PicturePlaces places) {
  NODAL_TRY_ASSIGN(const std::string text,
                   read_file(file, std::max(kMaxCalibrationBytes, interchange::kMaxProjectBytes)));
  if (text.find("\"nodal_calibration\"") != std::string::npos) {
    Result<Calibration> own = parse_calibration(text);
    if (!own) return fail(own.error().in(file));
    return Project{std::move(*own), {}, {}, {}, false};
  }
  Result<interchange::ImportResult> imported = interchange::import_project(text, fs::path(file).stem().string());
  if (!imported) return fail(imported.error().in(file));
  Project project{std::move(imported->calibration), {}, std::move(imported->notes), {}, true};
  if (std::ranges::any_of(imported->images, &std::string::empty)) return project;
  NODAL_TRY_ASSIGN(FoundPictures pictures, project_pictures(file, imported->images, places));
  project.pictures = std::move(pictures.files);
  project.picture_notes = std::move(pictures.notes);
  return project;
}

std::vector<std::string> names_of(const Calibration& calibration) {
  std::vector<std::string> names;
  for (const HeadCalibration& head : calibration.heads) names.push_back(head.name);
  return names;
}

/// One file may hold the pictures of several heads, side by side; two files with the same bytes are a mistake.
void tell_copies(const std::vector<std::string>& files, std::vector<std::string>& notes) {
  for (const auto& [later, earlier] : same_files(files)) {
    std::error_code error;
    if (fs::equivalent(files[later], files[earlier], error)) continue;
    notes.push_back(fmt::format("{} and {} are the same picture, for two heads", files[later], files[earlier]));
  }
}

PixelFormat common_format(const std::vector<DecodedImage>& pictures, bool rgb) {
  const auto all = [&](PixelFormat format) {
    return std::ranges::all_of(pictures, [format](const DecodedImage& picture) { return picture.format == format; });
  };
  if (rgb) return PixelFormat::kRgb24;
  return all(PixelFormat::kI420)    ? PixelFormat::kI420
         : all(PixelFormat::kGrey8) ? PixelFormat::kGrey8
                                    : PixelFormat::kRgb24;
}

}  // namespace

Result<StitchInput> read_stitch_input(const NominalWords& nominal, const std::vector<std::string>& arguments,
                                      PicturePlaces places) {
  if (!nominal.rig.empty()) {
    NODAL_TRY_ASSIGN(CalibratedPictures rig, read_nominal_pictures(nominal, arguments));
    NODAL_TRY_ASSIGN(auto sets, picture_files(arguments, names_of(rig.calibration)));
    return StitchInput{std::move(rig.calibration), std::move(sets), {}, true};
  }
  const std::string& file = arguments.front();
  // Pictures that the command line names replace those of the project, which are then not read, wherever they are.
  const bool named = arguments.size() > 1;
  NODAL_TRY_ASSIGN(Project project, read_project(file, named ? PicturePlaces::kAnywhere : places));
  std::vector<std::string> pictures(arguments.begin() + 1, arguments.end());
  if (pictures.empty()) {
    pictures = project.pictures;
    std::ranges::move(project.picture_notes, std::back_inserter(project.notes));
  }
  const std::size_t heads = project.calibration.heads.size();
  if (pictures.empty()) {
    return fail(Errc::kMissingField, fmt::format("no pictures; give one for each of the {} heads of {}", heads, file));
  }
  NODAL_TRY_ASSIGN(auto sets, picture_files(pictures, names_of(project.calibration)));
  tell_copies(sets.front(), project.notes);
  return StitchInput{std::move(project.calibration), std::move(sets), std::move(project.notes), project.imported};
}

Result<std::vector<DecodedImage>> read_set(const std::vector<std::string>& files, const Calibration& calibration,
                                           bool rgb) {
  NODAL_TRY_ASSIGN(std::vector<DecodedImage> read, read_all(
                                                       files, [](std::size_t) {}, linear_heads(calibration)));
  std::vector<DecodedImage> pictures = std::move(read);
  for (std::size_t h = 0; h < files.size(); ++h) {
    const HeadCalibration& head = calibration.heads[h];
    if (pictures[h].width != head.width || pictures[h].height != head.height) {
      return fail(Errc::kHeadMismatch,
                  fmt::format("{}: the picture has {}x{} pixels, and the calibration of head '{}' is for {}x{}; give "
                              "the pictures in the calibration's order and at the size they were calibrated at",
                              files[h], pictures[h].width, pictures[h].height, head.name, head.width, head.height));
    }
  }
  const PixelFormat format = common_format(pictures, rgb);
  for (DecodedImage& picture : pictures) {
    if (picture.format != format) picture = in_format(std::move(picture), format);
  }
  return pictures;
}

}  // namespace nodal::host
