// Raymeshes as files.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "stitch/geometry/envelope/envelope.h"
#include "stitch/mesh/raymesh.h"

namespace nodal::mesh {

/// kObj: Wavefront OBJ with the axes of rays, so that it can also be an envelope. kGlb: binary glTF 2.0. kMshp: the
/// mesh projection box of spherical video V2. The latter two have the axes of glTF: x right, y up, z backward.
enum class MeshFormat { kObj, kGlb, kMshp };

/// The format for the extension of a file's name: .obj, .glb or .mshp. Errors: kUnsupported.
Result<MeshFormat> mesh_format_of_name(std::string_view name);

/// `texture`: the name of the raymap's picture that a .glb refers to, relative to it; empty: none.
/// Errors: kTooLarge for more than a player of mshp boxes takes (10000 different coordinates, 32000 vertices, 128000
/// indices).
Result<std::vector<std::uint8_t>> encode_mesh(const Raymesh& mesh, MeshFormat format, const std::string& texture);

/// Reads files that encode_mesh() or another program wrote: the triangles of a .glb's scene, or the first mesh of an
/// mshp box. Points that are equal within a millionth of the farthest one's distance are merged.
/// Errors: kBadFormat, kTruncated, kTooLarge, kUnsupported; those of check_raymesh().
Result<Raymesh> decode_mesh(std::span<const std::uint8_t> bytes, MeshFormat format);

/// Reads the shape of a .glb, which needs no texture coordinates, as an envelope. Triangles without area are ignored.
/// Errors: those of decode_mesh() and of Envelope::from_mesh(), which then name the triangle, in the scene's order.
Result<geometry::Envelope> decode_envelope(std::span<const std::uint8_t> glb);

}  // namespace nodal::mesh
