// A raymap, or a film of raymaps, as the page needs it: facts, pictures that browsers read, triangles.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "host_tool/look/film.h"
#include "host_tool/look/server.h"
#include "host_tool/output/raymap_source.h"
#include "protocol/base/decoded_image.h"
#include "protocol/base/result.h"
#include "stitch/geometry/envelope/envelope.h"
#include "stitch/geometry/raymap/layout.h"

namespace nodal::host::look {

/// An envelope that the page offers.
struct NamedEnvelope {
  std::string title;   ///< what people read: "cube"
  std::string option;  ///< the value of --envelope that gives it: "cube:1.6"
  geometry::Envelope envelope;
};
/// Sphere, cube, dodecahedron, icosahedron, paraboloid and cylinder, all about as large.
std::vector<NamedEnvelope> usual_envelopes();

/// The most rays of a raymap without order that is shown as a sphere: its natural-neighbour mesh has twice as many
/// triangles.
inline constexpr std::int64_t kMaxScatteredRays = 500'000;

/// A picture is read at the start: a file that changes or vanishes later changes nothing. Of a film, pictures are read
/// as they are asked for. Answers:
///   scene.json                   what is shown: name, layout, size, notes, envelopes, words for `nodal view`
///   picture?side=N               the raymap, PNG or JPEG, its longer side at most N px
///   mesh.glb?envelope=K          the triangles on the Kth envelope, as glTF
///   eye?envelope=K&x=X&y=Y&z=Z   whether an eye there sees the Kth envelope's inner side only; otherwise why not
///   times.json                   of a film: ms from each picture to the next
///   frame?k=N                    of a film: picture N, JPEG
///
/// Threading: answer() from one thread at a time.
/// Errors: read(): those of read_raymap() and source_of(). answer(): a text with a sentence.
class Sphere {
 public:
  struct Options {
    std::string file;
    std::string from;                      ///< option --from
    std::vector<NamedEnvelope> envelopes;  ///< the first is shown first
    int threads = 0;
    std::shared_ptr<Film> film{};  ///< instead of the file: what a running rig sent first
    bool live = false;             ///< others follow
  };
  static Result<std::unique_ptr<Sphere>> read(const Options& options);

  Answer answer(const Wanted& wanted);
  /// What is said of the raymap, for the page and the terminal.
  const std::vector<std::string>& notes() const { return notes_; }

 private:
  explicit Sphere(const Options& options) : options_(options) {}
  Status arrange();
  Result<RaymapInput> read_input();
  void keep_stored();
  Answer scene() const;
  Answer picture(int side);
  Answer mesh(std::size_t envelope);
  Answer eye(const Wanted& wanted) const;
  Answer frame(std::size_t k);

  Options options_;
  std::shared_ptr<Film> film_;  ///< null: one picture
  DecodedImage picture_;
  std::shared_ptr<const std::vector<std::uint8_t>> stored_;  ///< the file's bytes, if browsers show the same
  std::string stored_type_;
  std::string layout_name_;  ///< the layout that the file has, as --from takes it
  int width_ = 0, height_ = 0;
  std::unique_ptr<geometry::RaymapLayout> layout_;  ///< layout of `picture_`
  double most_error_ = 0;                           ///< error that triangles may have, rad
  std::string flat_;                                ///< why it is shown flat; empty: as a sphere
  std::vector<std::string> notes_;
  std::map<std::size_t, Answer> meshes_;
  std::map<int, Answer> pictures_;
};

}  // namespace nodal::host::look
