#include "host_tool/film/film_list.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <optional>
#include <tuple>
#include <utility>

#include "host_tool/console/files.h"
#include "host_tool/film/attempts.h"
#include "host_tool/film/film_file.h"
#include "host_tool/film/film_plan.h"
#include "protocol/base/file_ending.h"
#include "protocol/base/try.h"

namespace nodal::film {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kListEnding = ".ffconcat";
constexpr std::size_t kMaxListBytes = std::size_t{64} << 20;
constexpr std::size_t kMaxFiles = 200'000;

std::optional<int> number_of(std::string_view digits) {
  int value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (error != std::errc() || end != digits.data() + digits.size()) return std::nullopt;
  return value;
}

bool all_digits(std::string_view text) {
  return !text.empty() && std::ranges::all_of(text, [](char c) { return c >= '0' && c <= '9'; });
}

/// A chapter of a GoPro's film by its name: GOPR0042, then GP010042, GP020042; or GX010042, GX020042.
struct Chapter {
  std::string film;  ///< equal for the chapters of one film in one folder
  int number = 0;
};
std::optional<Chapter> chapter_of(const std::string& path) {
  constexpr std::size_t kLength = 8;
  const std::string stem = fs::path(path).stem().string();
  if (stem.size() != kLength || stem[0] != 'G' || !all_digits(std::string_view(stem).substr(4))) return std::nullopt;
  const std::string of = fs::path(path).parent_path().string() + "/" + stem.substr(4);
  if (stem.starts_with("GOPR")) return Chapter{of, 0};
  const bool kind = std::string_view("HXLSP").find(stem[1]) != std::string_view::npos;
  if (!kind || !all_digits(std::string_view(stem).substr(2, 2))) return std::nullopt;
  // GoPro's older cameras call the first chapter GOPR, and the others GP.
  return Chapter{of + (stem[1] == 'P' ? "" : stem.substr(0, 2)), *number_of(std::string_view(stem).substr(2, 2))};
}

/// A name that ends in a number: what is before it, and the number.
struct Numbered {
  std::string before;
  int number = 0;
};
std::optional<Numbered> numbered(const std::string& path) {
  constexpr std::size_t kMaxDigits = 9;
  const std::string stem = fs::path(path).stem().string();
  std::size_t at = stem.size();
  while (at > 0 && all_digits(std::string_view(stem).substr(at - 1, 1)) && stem.size() - at < kMaxDigits) --at;
  if (at == stem.size()) return std::nullopt;
  return Numbered{stem.substr(0, at), *number_of(std::string_view(stem).substr(at))};
}

tl::unexpected<Error> gap(const std::string& before, const std::string& after) {
  return fail(Errc::kBadValue, fmt::format("{}: at least one file is missing between it and {}; add it, or name the "
                                           "files before and after it as films of their own",
                                           after, fs::path(before).filename().string()));
}

/// Puts chapters in order, and names one that is missing.
Status put_in_order(std::vector<std::string>& files, bool pictures) {
  const bool chapters =
      !pictures && std::ranges::all_of(files, [](const std::string& f) { return bool(chapter_of(f)); });
  const auto key = [&](const std::string& file) {
    if (chapters) {
      const Chapter chapter = *chapter_of(file);
      return std::tuple{chapter.film, chapter.number};
    }
    const std::optional<Numbered> name = numbered(file);
    return name ? std::tuple{name->before, name->number} : std::tuple{fs::path(file).stem().string(), -1};
  };
  std::ranges::sort(files, {}, [&](const std::string& file) { return std::tuple{key(file), file}; });
  for (std::size_t k = 1; k < files.size(); ++k) {
    const auto [film, number] = key(files[k]);
    const auto [film_before, number_before] = key(files[k - 1]);
    if (film == film_before && number > number_before + 1 && number_before >= 0) return gap(files[k - 1], files[k]);
    if (pictures && (film != film_before || number == number_before)) {
      return fail(Errc::kBadValue, fmt::format("{}: it does not belong to the numbered pictures of {}", files[k],
                                               fs::path(files[k - 1]).filename().string()));
    }
  }
  return {};
}

Result<HeadFiles> in_folder(const std::string& folder) {
  constexpr std::array<std::string_view, 5> kPictures{".jpg", ".jpeg", ".png", ".tif", ".tiff"};
  HeadFiles films, pictures;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    std::error_code unknown;
    const std::string path = entry->path().string(), name = entry->path().filename().string();
    if (name.starts_with('.') || !entry->is_regular_file(unknown)) continue;
    const bool picture = std::ranges::any_of(kPictures, [&](std::string_view e) { return has_ending(name, e); });
    const bool proxy = has_ending(name, ".lrv");  // a small copy for telephones
    if (picture) pictures.files.push_back(path);
    else if (is_film_name(name) && !proxy) films.files.push_back(path);
    if (films.files.size() + pictures.files.size() > kMaxFiles) {
      return fail(Errc::kTooLarge, fmt::format("{}: it has over {} files", folder, kMaxFiles));
    }
  }
  if (error) return fail(Errc::kIo, fmt::format("{}: {}", folder, error.message()));
  if (films.files.empty() && pictures.files.empty()) {
    return fail(Errc::kNotFound, fmt::format("{}: the folder has no films and no pictures", folder));
  }
  if (!films.files.empty() && !pictures.files.empty()) {
    return fail(Errc::kBadValue, fmt::format("{}: the folder has films and pictures; move the ones away that are no "
                                             "frames of this head, such as {}",
                                             folder, fs::path(pictures.files.front()).filename().string()));
  }
  pictures.pictures = true;
  HeadFiles head = films.files.empty() ? std::move(pictures) : std::move(films);
  NODAL_TRY(put_in_order(head.files, head.pictures));
  const fs::path path = fs::path(folder).lexically_normal();
  head.name = (path.has_filename() ? path : path.parent_path()).filename().string();
  return head;
}

std::string quoted(const std::string& text) {
  std::string all = "'";
  for (const char c : text) all += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return all + "'";
}

/// Length of a chapter's pictures, in microseconds; checks that it goes with the first.
Result<std::int64_t> length_of(const Programs& programs, const std::string& file, std::optional<FilmFile>& first) {
  NODAL_TRY_ASSIGN(FilmFile film, probe(programs, file));
  const double period = 1.0 * film.rate->denominator / film.rate->numerator;
  const auto length = std::llround(1e6 * (film.seconds(film.times.size() - 1) + period));
  if (!first) first = std::move(film);
  else if (film.width != first->width || film.height != first->height || film.coded_format != first->coded_format) {
    return fail(Errc::kHeadMismatch,
                fmt::format("{}: its pictures are {}x{} {}, and those of {} are {}x{} {}; chapters of one film are "
                            "alike",
                            file, film.width, film.height, film.coded_format, first->path, first->width, first->height,
                            first->coded_format));
  }
  return length;
}

}  // namespace

bool is_list(const std::string& path) { return has_ending(path, kListEnding); }

Result<std::vector<HeadFiles>> files_of_heads(const std::vector<std::string>& inputs) {
  std::vector<HeadFiles> heads;
  std::vector<std::string> chaptered;  // by head: the film that its chapters are of
  for (const std::string& input : inputs) {
    const std::string path = fs::absolute(input).string();
    std::error_code error;
    if (fs::is_directory(path, error)) {
      NODAL_TRY_ASSIGN(HeadFiles head, in_folder(path));
      heads.push_back(std::move(head));
      chaptered.emplace_back();
      continue;
    }
    const std::optional<Chapter> chapter = chapter_of(path);
    const auto known = chapter ? std::ranges::find(chaptered, chapter->film) : chaptered.end();
    if (known != chaptered.end()) {
      heads[static_cast<std::size_t>(known - chaptered.begin())].files.push_back(path);
      continue;
    }
    heads.push_back({fs::path(path).stem().string(), {path}, false});
    chaptered.push_back(chapter ? chapter->film : "");
  }
  for (HeadFiles& head : heads) {
    if (head.files.size() == 1 || head.pictures) continue;
    NODAL_TRY(put_in_order(head.files, false));
  }
  for (std::size_t h = 0; h < heads.size(); ++h) {
    const auto same = [&](const HeadFiles& other) { return other.name == heads[h].name; };
    if (std::ranges::count_if(heads, same) > 1 && heads[h].files.size() > 1) heads[h].name += fmt::format("-{}", h + 1);
  }
  return heads;
}

Result<std::string> make_list(const Programs& programs, const HeadFiles& head, int rate, const SizeOfPicture& size_of,
                              const std::string& folder) {
  std::string identities;
  for (const std::string& file : head.files) {
    if (file.find('\n') != std::string::npos) {
      return fail(Errc::kBadValue, fmt::format("{}: a name with a line break is no name of a chapter", file));
    }
    NODAL_TRY_ASSIGN(const Json identity, identity_of(file));
    identities += "# " + identity.dump(-1, ' ', true, Json::error_handler_t::replace) + "\n";
  }
  if (head.pictures) identities += fmt::format("# {} a second\n", rate);
  const std::string begin = "ffconcat version 1.0\n" + identities;
  const std::string list = fmt::format("{}/{}{}", folder, head.name, kListEnding);
  if (const auto stored = host::read_file(list, kMaxListBytes); stored && stored->starts_with(begin)) return list;

  std::string text = begin;
  std::optional<FilmFile> first;
  std::optional<PictureSize> size;
  for (std::size_t k = 0; k < head.files.size(); ++k) {
    const std::string& file = head.files[k];
    std::int64_t length = 0;  // microseconds
    text += "file " + quoted(file_url(file)) + "\n";
    if (head.pictures) {
      NODAL_TRY_ASSIGN(const PictureSize own, size_of(file));
      if (size.value_or(own) != own) {
        return fail(Errc::kHeadMismatch, fmt::format("{}: it has {}x{} pixels, and {} has {}x{}", file, own.width,
                                                     own.height, head.files.front(), size->width, size->height));
      }
      size = own;
      const auto begins = [&](std::size_t n) { return std::llround(1e6 * static_cast<double>(n) / rate); };
      length = begins(k + 1) - begins(k);
      text += fmt::format("option framerate {}\n", rate);
    } else {
      NODAL_TRY_ASSIGN(length, length_of(programs, file, first));
    }
    text += fmt::format("duration {}.{:06}\n", length / 1'000'000, length % 1'000'000);
  }
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) return fail(Errc::kIo, fmt::format("{}: it cannot be made: {}", folder, error.message()));
  const std::string attempt = attempt_name(list);
  fs::remove(attempt, error);
  NODAL_TRY(host::write_file(attempt, text));
  fs::rename(attempt, list, error);
  if (error) return fail(Errc::kIo, fmt::format("{}: {}", list, error.message()));
  return list;
}

}  // namespace nodal::film
