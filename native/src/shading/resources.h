// What ops may read besides the shading point: the images of the scene, and the scene itself for attributes.
#pragma once
#include <memory>

namespace gi {

class Scene;
class ImageSet;
struct Camera;

struct ShaderResources {
  std::shared_ptr<const ImageSet> images;
  const Scene* scene = nullptr;  // set by Scene
  mutable const Camera* camera = nullptr;  // set by Session, for the nodes that ask for it
};

}  // namespace gi
