#version 450
// Colour, position and entity of a pixel in one pass: lamps from afar and light from everywhere,
// no shadows. What a picture costs without a GPU is the work of each pixel.

layout(constant_id = 0) const int NUM_DIRECTIONAL_LIGHTS = 0;

layout(set = 0, binding = 0) uniform CameraBuffer {
  mat4 viewMatrix;
  mat4 projectionMatrix;
  mat4 viewMatrixInverse;
  mat4 projectionMatrixInverse;
  float width;
  float height;
} cameraBuffer;

layout(set = 1, binding = 0) uniform ObjectTransformBuffer {
  mat4 modelMatrix;
} objectTransformBuffer;

layout(set = 1, binding = 1) uniform ObjectDataBuffer {
  uvec4 segmentation;
  float transparency;
  int shadeFlat;
} objectDataBuffer;

layout(set = 2, binding = 0) uniform MaterialBuffer {
  vec4 emission;
  vec4 baseColor;
  float fresnel;
  float roughness;
  float metallic;
  float transmission;
  float ior;
  float transmissionRoughness;
  int textureMask;
  int padding1;
  vec4 textureTransforms[6];
} materialBuffer;

layout(set = 2, binding = 1) uniform sampler2D colorTexture;
layout(set = 2, binding = 2) uniform sampler2D roughnessTexture;
layout(set = 2, binding = 3) uniform sampler2D normalTexture;
layout(set = 2, binding = 4) uniform sampler2D metallicTexture;
layout(set = 2, binding = 5) uniform sampler2D emissionTexture;
layout(set = 2, binding = 6) uniform sampler2D transmissionTexture;

struct PointLight {
  vec4 position;
  vec4 emission;
};
struct DirectionalLight {
  vec4 direction;
  vec4 emission;
};
struct SpotLight {
  vec4 position;
  vec4 direction;
  vec4 emission;
};

layout(set = 3, binding = 0) uniform SceneBuffer {
  vec4 ambientLight;
  PointLight pointLights[10];
  DirectionalLight directionalLights[3];
  SpotLight spotLights[10];
  SpotLight texturedLights[1];
} sceneBuffer;

layout(location = 0) in vec3 positionWorld;
layout(location = 1) in vec3 normalWorld;
layout(location = 2) in vec2 texturePlace;

layout(location = 0) out vec4 outColor;
layout(location = 1) out ivec4 outPositionSegmentation;

const float PI = 3.14159265;

// Reflected share of a lamp's light off a rough surface: microfacets by the distribution of
// Trowbridge and Reitz, masked as by Schlick, with his Fresnel term. Of the cosines those of the
// direction halfway between light and eye would cost a root each: the sum of both unit directions,
// whose squared length is ``sum2``, stands in for it.
vec3 reflected(float toLight, float toEye, float toSum, float sum2, float rough, vec3 straight) {
  float a2 = rough * rough * rough * rough;
  float k = (rough + 1.0) * (rough + 1.0) / 8.0;
  float spread = min(toSum * toSum, sum2) * (a2 - 1.0) + sum2;
  float away = 1.0 - 0.5 * sqrt(sum2);
  float away2 = away * away;
  vec3 fresnel = straight + (1.0 - straight) * (away2 * away2 * away);
  float masked = (toEye * (1.0 - k) + k) * (toLight * (1.0 - k) + k);
  float scale = sum2 * sum2;
  return fresnel * (a2 * scale / max(4.0 * PI * spread * spread * masked, 1e-6 * scale));
}

// color to the power 1 / 2.2, to a ninth of what a byte can tell apart: two roots take less time
// than a power.
vec3 displayed(vec3 color) {
  vec3 root2 = sqrt(color);
  vec3 root4 = sqrt(root2);
  return root2 * (1.2411187 - 0.41537585 * root4) + 0.03344254 * root4 + 0.14123923 * color;
}

void main() {
  vec4 base = materialBuffer.baseColor;
  if ((materialBuffer.textureMask & 1) != 0) {
    base = texture(colorTexture, texturePlace);
  }
  vec3 diffuse = base.rgb * ((1.0 - materialBuffer.metallic) / PI);
  vec3 straight = mix(vec3(0.08 * materialBuffer.fresnel), base.rgb, materialBuffer.metallic);
  // Unit at the vertices, a little shorter between them: Newton's steps towards 1 / length.
  float length2 = dot(normalWorld, normalWorld);
  float stretch = 1.5 - 0.5 * length2;
  stretch *= 1.5 - 0.5 * length2 * stretch * stretch;
  vec3 normal = stretch * normalWorld;
  vec3 eye = normalize(cameraBuffer.viewMatrixInverse[3].xyz - positionWorld);
  float toEye = clamp(dot(normal, eye), 1e-6, 1.0);

  vec3 color = materialBuffer.emission.rgb + sceneBuffer.ambientLight.rgb * base.rgb;
  for (int i = 0; i < NUM_DIRECTIONAL_LIGHTS; ++i) {
    // SAPIEN keeps directions of unit length.
    vec3 light = -sceneBuffer.directionalLights[i].direction.xyz;
    float toLight = dot(normal, light);
    if (toLight > 0.0) {
      float sum2 = max(2.0 + 2.0 * dot(light, eye), 1e-6);
      float toSum = max(toLight + dot(normal, eye), 0.0);
      vec3 share = diffuse + reflected(
          toLight, toEye, toSum, sum2, materialBuffer.roughness, straight);
      color += sceneBuffer.directionalLights[i].emission.rgb * (toLight * share);
    }
  }
  outColor = vec4(displayed(clamp(color, 0.0, 1.0)), 1.0);
  // Of the position only z, the camera looking along -z: whole millimetres, to the nearest.
  int z = int(round(-1000.0 / gl_FragCoord.w));
  outPositionSegmentation = ivec4(0, 0, z, int(objectDataBuffer.segmentation[1]));
}
