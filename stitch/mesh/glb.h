// Numbers of binary glTF 2.0 (Khronos): a header of 12 bytes, a chunk of JSON, a chunk of buffers; little-endian.
#pragma once

#include <cstdint>

namespace nodal::mesh::glb {

inline constexpr std::uint32_t kMagic = 0x4654'6C67, kJsonChunk = 0x4E4F'534A, kBinChunk = 0x004E'4942;
inline constexpr int kFloat = 5126, kByte = 5121, kShort = 5123, kInt = 5125;  ///< componentType

}  // namespace nodal::mesh::glb
