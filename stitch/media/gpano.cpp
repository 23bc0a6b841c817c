#include "stitch/media/gpano.h"

namespace nodal::media {

std::string gpano_packet(int width, int height) {
  const std::string w = std::to_string(width);
  const std::string h = std::to_string(height);
  return "<?xpacket begin=\"\xef\xbb\xbf\" id=\"W5M0MpCehiHzreSzNTczkc9d\"?>\n"
         "<x:xmpmeta xmlns:x=\"adobe:ns:meta/\" x:xmptk=\"Nodal\">\n"
         " <rdf:RDF xmlns:rdf=\"http://www.w3.org/1999/02/22-rdf-syntax-ns#\">\n"
         "  <rdf:Description rdf:about=\"\" xmlns:GPano=\"http://ns.google.com/photos/1.0/panorama/\"\n"
         "   GPano:ProjectionType=\"equirectangular\"\n"
         "   GPano:UsePanoramaViewer=\"True\"\n"
         "   GPano:StitchingSoftware=\"Nodal\"\n"
         "   GPano:PoseHeadingDegrees=\"0\"\n"
         "   GPano:CroppedAreaImageWidthPixels=\"" +
         w +
         "\"\n"
         "   GPano:CroppedAreaImageHeightPixels=\"" +
         h +
         "\"\n"
         "   GPano:FullPanoWidthPixels=\"" +
         w +
         "\"\n"
         "   GPano:FullPanoHeightPixels=\"" +
         h +
         "\"\n"
         "   GPano:CroppedAreaLeftPixels=\"0\"\n"
         "   GPano:CroppedAreaTopPixels=\"0\"/>\n"
         " </rdf:RDF>\n"
         "</x:xmpmeta>\n"
         "<?xpacket end=\"r\"?>";
}

}  // namespace nodal::media
