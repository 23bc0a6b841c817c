#include "host_tool/input/own_pictures.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <optional>
#include <set>
#include <utility>

#include "stitch/autocalibration/autocalibration.h"
#include "stitch/media/image_file.h"

namespace nodal::host {
namespace {

namespace fs = std::filesystem;

constexpr int kRefinedWidth = 2048;  // px, of the raymap that differences are summed on

bool is_folder(const std::string& path) {
  std::error_code error;
  return fs::is_directory(path, error);
}

std::vector<std::string> pictures_in(const std::string& folder) {
  std::vector<std::string> found;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    if (entry.is_regular_file(error) && media::read_image_header(entry.path())) found.push_back(entry.path().string());
  }
  std::ranges::sort(found);
  return found;
}

/// The files' names without their endings if all of them can be heads' names, else cam0, cam1 and so on.
std::vector<std::string> head_names(const std::vector<std::string>& files) {
  std::vector<std::string> names, numbered;
  std::set<std::string> different;
  const auto plain = [](unsigned char c) { return std::isalnum(c) != 0 || c == '.' || c == '_' || c == '-'; };
  bool good = true;
  for (const std::string& file : files) {
    numbered.push_back("cam" + std::to_string(names.size()));
    names.push_back(fs::path(file).stem().string());
    good = good && !names.back().empty() && names.back().size() <= 64 && std::ranges::all_of(names.back(), plain) &&
           different.insert(names.back()).second;
  }
  return good ? names : numbered;
}

bool all_placed(const registration::Report& report) {
  return std::ranges::all_of(report.heads, [](const registration::HeadReport& head) { return head.placed; });
}

}  // namespace

bool is_picture(const std::string& path) {
  if (is_folder(path)) return !pictures_in(path).empty();
  return media::read_image_header(path).has_value();
}

Result<std::vector<std::string>> own_picture_files(const std::vector<std::string>& arguments) {
  std::vector<std::string> files;
  for (const std::string& argument : arguments) {
    if (!is_folder(argument)) {
      if (const Result<ImageHeader> header = media::read_image_header(argument); !header) return fail(header.error());
      files.push_back(argument);
      continue;
    }
    const std::vector<std::string> inside = pictures_in(argument);
    if (inside.empty()) return fail(Errc::kNotFound, argument + ": there is no picture in this folder");
    files.insert(files.end(), inside.begin(), inside.end());
  }
  return files;
}

Result<FirstCalibration> first_calibration(const std::vector<std::string>& files, const OwnProgress& progress) {
  std::vector<DecodedImage> images, grey;
  for (const std::string& file : files) {
    progress(0.3 * static_cast<double>(images.size()) / static_cast<double>(files.size()), "reading " + file);
    Result<DecodedImage> image = media::read_image(file);
    if (!image) return fail(image.error());
    grey.push_back(media::convert_image(image->view(), PixelFormat::kGrey8));
    images.push_back(std::move(*image));
  }
  autocalibration::Options options;
  options.progress = [&](double done) { progress(0.3 + 0.7 * done, "matching the pictures"); };
  Result<autocalibration::Found> found = autocalibration::autocalibrate(grey, head_names(files), options);
  if (!found) return fail(found.error());
  FirstCalibration first;
  first.calibration = std::move(found->calibration);
  std::vector<bool> used(files.size());
  for (const std::size_t n : found->placed) {
    used[n] = true;
    first.placed.push_back(files[n]);
    first.images.push_back(std::move(images[n]));
  }
  for (std::size_t n = 0; n < files.size(); ++n) {
    if (used[n]) continue;
    first.notes.push_back(fmt::format("{} is left out: it shares too little with the other pictures", files[n]));
  }
  if (!found->upright) {
    first.notes.push_back("which way is up is a guess by the light: too few edges of the scene are vertical");
  }
  first.confidence = fmt::format(
      "{} of {} pictures placed by {} points that two of them show; the points agree within "
      "{:.1f} px (median)",
      first.placed.size(), files.size(), found->matches, found->error_px);
  return first;
}

Result<registration::Report> refined(const FirstCalibration& first, const OwnProgress& progress) {
  registration::FrameSet frames;
  for (const DecodedImage& image : first.images) frames.push_back(image.view());
  std::optional<registration::Report> best;
  // Light first: it nearly always succeeds, and the other results are compared with it.
  constexpr std::array<std::pair<registration::Free, const char*>, 3> kStages{
      {{registration::Free::kRotations, "matching the light"},
       {registration::Free::kLens, "registering the lenses"},
       {registration::Free::kFocals, "registering the focal lengths"}}};
  Error error;
  for (std::size_t stage = 0; stage < kStages.size(); ++stage) {
    registration::Options options;
    options.free = kStages[stage].first;
    options.geometry = stage > 0;
    options.search = false;
    options.width = kRefinedWidth;
    options.progress = [&](const registration::Step&, double done) {
      progress((static_cast<double>(stage) + done) / kStages.size(), kStages[stage].second);
    };
    Result<registration::Report> report = registration::register_heads(first.calibration, {frames}, options);
    if (!report) {
      if (report.error().code == Errc::kCancelled) return fail(report.error());
      error = report.error();
      continue;
    }
    if (stage == 0) {
      best = std::move(*report);
    } else if (all_placed(*report) && (!best || report->objective_after < best->objective_after)) {
      best = std::move(*report);
      break;
    }
  }
  if (!best) return fail(error);
  return std::move(*best);
}

}  // namespace nodal::host
