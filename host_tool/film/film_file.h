// What a film's file has, as ffprobe reads it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "host_tool/film/programs.h"
#include "host_tool/film/rational.h"
#include "protocol/base/image.h"
#include "protocol/base/result.h"
#include "protocol/base/units.h"

namespace nodal::film {

/// A film's sound, its first track.
struct FilmSound {
  std::string codec;    ///< ffmpeg's name: "aac"
  int rate = 0;         ///< Hz
  double starts_s = 0;  ///< seconds of the film's own time
};

struct FilmFile {
  std::string path;
  int track = 0;   ///< which of its tracks of pictures; the first one is 0
  int tracks = 1;  ///< how many it has, covers not counted
  int width = 0;   ///< px, of the head's pictures
  int height = 0;
  /// Where these are in the coded pictures, if they are a part of them: several heads' pictures side by side.
  struct Place {
    int left = 0, top = 0;
  };
  std::optional<Place> place;
  std::string coded_format;    ///< ffmpeg's name of the pixel format: "yuvj420p"
  PixelFormat format{};        ///< its pictures' after decoding
  std::string decoded_format;  ///< ffmpeg's name of that
  ColourCoding coding;         ///< how Y, U and V are coded
  std::string transfer;        ///< ffmpeg's name; empty: not said
  int rotation_deg = 0;        ///< by how much the file asks viewers to rotate its pictures
  bool interlaced = false;
  std::optional<FrameRate> rate;
  double file_starts_s = 0;         ///< begin of the file's earliest stream, in the file's own time
  Rational time_base;               ///< unit of `times`
  std::vector<std::int64_t> times;  ///< all frames that are shown, in order, without doubles
  std::uint64_t announced = 0;      ///< frames that the file says it has; 0: it does not say
  std::optional<FilmSound> sound;
  std::optional<int> gpmf;          ///< stream with GoPro's telemetry
  std::optional<double> created_s;  ///< when it was begun by the camera's clock, seconds of an unknown origin
  std::uint64_t bytes = 0;          ///< size of the file
  std::vector<std::string> notes;   ///< whole sentences, without the file's name

  /// Seconds after its first frame.
  double seconds(std::size_t frame) const { return seconds_of(times[frame] - times.front(), time_base); }
};

/// Reads a film's streams and the times of its frames. The whole file is read, but nothing is decoded.
/// Errors: with the file: kNotFound, kBadFormat (no film, or damaged), kUnsupported (HLG and PQ), kTooLarge.
/// `track`: which of its tracks of pictures.
Result<FilmFile> probe(const Programs& programs, const std::string& path, int track = 0);

/// The same of ffprobe's two answers, without `path`, `bytes`.
Result<FilmFile> film_of(const std::string& streams_json, const std::string& packets_csv, int track = 0);

/// The first sound track of a file. Errors: as probe(); kBadFormat if it has none.
Result<FilmSound> probe_sound(const Programs& programs, const std::string& path);

/// The n-th of the pictures side by side in a film, row by row; cut at even rows and columns.
FilmFile part_of(FilmFile film, int columns, int rows, int n);

/// ffmpeg's filters that give the head's pictures, then `next`; empty: none.
std::string filters_of(const FilmFile& film, const std::string& next = "");

/// Whether the name is that of a film file, such as cam0.MP4.
bool is_film_name(std::string_view path);

}  // namespace nodal::film
