// PTGui's text project, version 9 and older. Image lines begin with o; the first may be a dummy that only holds the
// variables to which the others link.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <sstream>

#include "protocol/base/try.h"
#include "protocol/base/units.h"
#include "protocol/calibration_limits.h"
#include "stitch/interchange/import.h"
#include "stitch/interchange/known_fields.h"
#include "stitch/interchange/panotools_fields.h"
#include "stitch/interchange/panotools_head.h"
#include "stitch/interchange/panotools_script.h"
#include "stitch/interchange/project.h"

namespace nodal::interchange {
namespace {

/// The data in the comments before an image line.
struct ImageFile {
  int width = 0;
  int height = 0;
  std::string path;
};

/// Parses e.g. #-imgfile 3840 2160 "input-00.jpg"
Result<ImageFile> read_image_file(const ScriptLine& line) {
  const auto bad = [&] {
    return fail(
        Errc::kBadFormat,
        fmt::format("line {}: #-imgfile should be followed by width, height and a name in quotes", line.number));
  };
  const std::size_t quote = line.comment.find('"');
  const std::size_t last = line.comment.rfind('"');
  if (quote == std::string::npos || last == quote) return bad();
  std::istringstream sizes(line.comment.substr(9, quote - 9));
  sizes.imbue(std::locale::classic());
  ImageFile file;
  if (!(sizes >> file.width >> file.height)) return bad();
  if (file.width < 1 || file.height < 1 || file.width > 32768 || file.height > 32768) {
    return fail(Errc::kBadValue, fmt::format("line {}: a picture's sides must be 1 to 32768 px", line.number));
  }
  file.path = line.comment.substr(quote + 1, last - quote - 1);
  return file;
}

/// The lines of a project, sorted by meaning.
struct Project {
  ImageLines lines;              // includes the dummy, because links count it
  std::vector<ImageFile> files;  // one per image except the dummy
  bool has_dummy = false;
};

Result<Project> read_project(const std::vector<ScriptLine>& lines) {
  Project project;
  std::optional<ImageFile> file;
  bool dummy_next = false;
  for (const ScriptLine& line : lines) {
    const std::string& comment = line.comment;
    if (comment.starts_with("#-dummyimage")) dummy_next = true;
    if (comment.starts_with("#-imgfile")) {
      NODAL_TRY_ASSIGN(ImageFile read, read_image_file(line));
      file = std::move(read);
    }
    if (line.kind != 'o') continue;
    if (dummy_next && project.lines.size() == 0) {
      project.has_dummy = true;
    } else if (!file) {
      return fail(Errc::kMissingField, fmt::format("line {}: no #-imgfile says how large this image is", line.number));
    } else {
      project.files.push_back(std::move(*file));
    }
    project.lines.add(&line);
    dummy_next = false;
    file.reset();
  }
  if (file) return fail(Errc::kTruncated, "the file ends before the image line (o) of '" + file->path + "'");
  return project;
}

Result<HeadCalibration> read_head(const Project& project, std::size_t image, const std::vector<std::string>& taken,
                                  std::vector<std::string>& notes) {
  const std::size_t o = image + (project.has_dummy ? 1 : 0);
  const ImageFile& file = project.files[image];
  PanotoolsImage read;
  read.name = head_name(file.path, taken);
  read.width = file.width;
  read.height = file.height;
  NODAL_TRY(read_geometry(project.lines, o, read));
  read.lens = {0, static_cast<double>(file.width), 0, static_cast<double>(file.height)};
  if (const std::string* kept = project.lines[o].find("C")) {
    NODAL_TRY_ASSIGN(const auto crop, to_four_numbers(project.lines[o], "C", *kept));
    // If there is a crop, the field of view, the polynomial and the centre all refer to it.
    read.lens = {crop[0], crop[1], crop[2], crop[3]};
    read.region = read.lens;
  }
  return to_head(read, notes);
}

/// Compares the fields of all lines with the table.
Status check_all(const std::vector<ScriptLine>& lines, const Project& project, ImportResult& result) {
  constexpr std::string_view kSetting = "#-";
  FieldCheck check(ptgui_fields());
  for (const ScriptLine& line : lines) {
    if (line.comment.starts_with(kSetting)) {
      const Attribute setting = setting_of(line.comment.substr(kSetting.size()));
      check.see(kSetting, setting.name, setting.value);
    }
    if (line.kind == '#') continue;
    check.see("file", line.kind == '*' ? "end" : std::string(1, line.kind), "");
    if (line.kind == 'c') see_variables(line, check);
  }
  for (std::size_t i = 0; i < project.files.size(); ++i) {
    const std::string whose = "head '" + result.calibration.heads[i].name + "'";
    NODAL_TRY(see_image(project.lines, i + (project.has_dummy ? 1 : 0), "o", whose, check));
  }
  return check.tell(result.notes);
}

}  // namespace

Result<ImportResult> import_pts(std::string_view text, std::string_view name) {
  NODAL_TRY_ASSIGN(const std::vector<ScriptLine> lines, parse_script(text, kMaxProjectBytes));
  NODAL_TRY_ASSIGN(const Project project, read_project(lines));
  if (project.files.empty()) {
    return fail(Errc::kBadFormat, "there is no image (#-imgfile and an o line) in it: it is not a PTGui text project");
  }
  if (project.files.size() > kMaxCalibratedHeads) {
    return fail(Errc::kUnsupported, fmt::format("the project has {} images; a calibration has 1 to {} heads",
                                                project.files.size(), kMaxCalibratedHeads));
  }
  ImportResult result;
  result.calibration.name = std::string(name);
  result.calibration.comment = "Imported from a PTGui project.";
  std::vector<std::string> taken;
  for (std::size_t i = 0; i < project.files.size(); ++i) {
    NODAL_TRY_ASSIGN(HeadCalibration head, read_head(project, i, taken, result.notes));
    taken.push_back(head.name);
    result.images.emplace_back(project.files[i].path);
    result.calibration.heads.push_back(std::move(head));
  }
  std::vector<std::optional<std::size_t>> head_of;
  for (std::size_t i = 0; i < project.files.size(); ++i) head_of.emplace_back(i);
  NODAL_TRY(add_control_points(lines, head_of, result, project.has_dummy ? 1 : 0));
  NODAL_TRY(check_all(lines, project, result));
  NODAL_TRY(check_calibration(result.calibration));
  return result;
}

}  // namespace nodal::interchange
