// PTGui's text project, version 9 and older. Image lines begin with o; the first may be a dummy that only holds the
// variables to which the others link.
#include <algorithm>
#include <cmath>
#include <sstream>

#include "protocol/base/units.h"
#include "protocol/calibration_limits.h"
#include "stitch/interchange/import.h"
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
    return fail(Errc::kBadFormat, "line " + std::to_string(line.number) +
                                      ": #-imgfile should be followed by width, height and a name in quotes");
  };
  const std::size_t quote = line.comment.find('"');
  const std::size_t last = line.comment.rfind('"');
  if (quote == std::string::npos || last == quote) return bad();
  std::istringstream sizes(line.comment.substr(9, quote - 9));
  sizes.imbue(std::locale::classic());
  ImageFile file;
  if (!(sizes >> file.width >> file.height)) return bad();
  if (file.width < 1 || file.height < 1 || file.width > 32768 || file.height > 32768) {
    return fail(Errc::kBadValue, "line " + std::to_string(line.number) + ": a picture's sides must be 1 to 32768 px");
  }
  file.path = line.comment.substr(quote + 1, last - quote - 1);
  return file;
}

/// Whether a comment holds anything besides its keyword and zeros.
bool says_something(const std::string& comment, std::size_t keyword) {
  return comment.find_first_not_of(" 0.\t-", keyword) != std::string::npos;
}

/// The lines of a project, sorted by meaning.
struct Project {
  ImageLines lines;              // includes the dummy, because links count it
  std::vector<ImageFile> files;  // for every image except the dummy
  bool has_dummy = false;
  bool masks = false, vignetting = false, curve = false, exposures = false, viewpoints = false;
};

Result<Project> read_project(const std::vector<ScriptLine>& lines) {
  Project project;
  std::optional<ImageFile> file;
  bool dummy_next = false;
  for (const ScriptLine& line : lines) {
    const std::string& comment = line.comment;
    if (comment.starts_with("#-dummyimage")) dummy_next = true;
    if (comment.starts_with("#-imgfile")) {
      Result<ImageFile> read = read_image_file(line);
      if (!read) return fail(read.error());
      file = std::move(*read);
    }
    project.masks = project.masks || comment.starts_with("#-sourcemask") || line.kind == 'k';
    project.vignetting =
        project.vignetting || (comment.starts_with("#-vignettingparams") && says_something(comment, 18));
    project.curve = project.curve || (comment.starts_with("#-cameracurve") && says_something(comment, 13));
    project.exposures = project.exposures || (comment.starts_with("#-exposureparams") && says_something(comment, 16));
    project.viewpoints = project.viewpoints || (comment.starts_with("#-viewpoint ") && says_something(comment, 12));
    if (line.kind != 'o') continue;
    if (dummy_next && project.lines.size() == 0) {
      project.has_dummy = true;
    } else if (!file) {
      return fail(Errc::kMissingField,
                  "line " + std::to_string(line.number) + ": no #-imgfile says how large this image is");
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
  if (Status s = read_geometry(project.lines, o, read); !s) return fail(s.error());
  read.lens = {0, static_cast<double>(file.width), 0, static_cast<double>(file.height)};
  if (const std::string* kept = project.lines[o].find("C")) {
    const Result<std::array<double, 4>> crop = to_four_numbers(project.lines[o], "C", *kept);
    if (!crop) return fail(crop.error());
    // If there is a crop, the field of view, the polynomial and the centre all refer to it.
    read.lens = {(*crop)[0], (*crop)[1], (*crop)[2], (*crop)[3]};
    read.region = read.lens;
  }
  for (const char* name : {"g", "t"}) {
    const Result<double> value = project.lines.number_or(o, name, 0);
    if (!value) return fail(value.error());
    if (*value != 0) {
      notes.push_back("Head '" + read.name + "' has " + name + " = " + short_number(*value) +
                      ", a shear of its picture: Nodal has none, and leaves it out.");
    }
  }
  return to_head(read, notes);
}

void note_what_is_left_out(const Project& project, std::vector<std::string>& notes) {
  if (project.vignetting) {
    notes.push_back("Vignetting (#-vignettingparams) is left out: PTGui does not say what its numbers mean.");
  }
  if (project.curve) {
    notes.push_back(
        "The camera curve (#-cameracurve) is left out, for the same reason; the response is taken as linear.");
  }
  if (project.exposures) {
    notes.push_back("Exposure and white balance corrections (#-exposureparams) are left out: all gains are 1.");
  }
  if (project.masks)
    notes.push_back("Masks are left out: PTGui paints them, and Nodal's are polygons; draw them in region.masks.");
  if (project.viewpoints) notes.push_back("Viewpoint corrections are left out: all heads share the nodal point.");
}

}  // namespace

Result<ImportResult> import_pts(std::string_view text, std::string_view name) {
  const Result<std::vector<ScriptLine>> lines = parse_script(text, kMaxProjectBytes);
  if (!lines) return fail(lines.error());
  const Result<Project> project = read_project(*lines);
  if (!project) return fail(project.error());
  if (project->files.empty()) {
    return fail(Errc::kBadFormat, "there is no image (#-imgfile and an o line) in it: it is not a PTGui text project");
  }
  if (project->files.size() > kMaxCalibratedHeads) {
    return fail(Errc::kUnsupported, "the project has " + std::to_string(project->files.size()) +
                                        " images; a calibration has 1 to " + std::to_string(kMaxCalibratedHeads) +
                                        " heads");
  }
  ImportResult result;
  result.calibration.name = std::string(name);
  result.calibration.comment = "Imported from a PTGui project.";
  std::vector<std::string> taken;
  for (std::size_t i = 0; i < project->files.size(); ++i) {
    Result<HeadCalibration> head = read_head(*project, i, taken, result.notes);
    if (!head) return fail(head.error());
    taken.push_back(head->name);
    result.images.emplace_back(project->files[i].path);
    result.calibration.heads.push_back(std::move(*head));
  }
  note_what_is_left_out(*project, result.notes);
  if (Status s = add_control_points(*lines, project->has_dummy ? 1 : 0, result); !s) return fail(s.error());
  if (Status s = check_calibration(result.calibration); !s) return fail(s.error());
  return result;
}

}  // namespace nodal::interchange
