// What ops may read besides the shading point: the images of the scene, and the scene itself for attributes.
#pragma once
#include <memory>

namespace gi {

class Scene;
class ImageSet;

struct ShaderResources {
  std::shared_ptr<const ImageSet> images;
  const Scene* scene = nullptr;  // set by Scene
};

}  // namespace gi
