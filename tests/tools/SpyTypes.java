// Exits with 0 when lcm-spy's own catalogue, made of the class path, knows every type that is named, and
// reads a message of it with a seal behind.
import java.io.ByteArrayOutputStream;
import java.io.DataOutputStream;
import java.lang.reflect.Array;
import java.lang.reflect.Field;
import lcm.lcm.LCMEncodable;
import lcm.spy.LCMTypeDatabase;

public class SpyTypes {
  private static final int SEAL_SIZE = 32;

  public static void main(String[] names) throws Exception {
    LCMTypeDatabase database = new LCMTypeDatabase();
    for (String name : names) {
      Class<?> type = Class.forName(name);
      Class<?> found = database.getClassByFingerprint(type.getField("LCM_FINGERPRINT").getLong(null));
      if (found == null || !found.getName().equals(name)) {
        System.err.println("lcm-spy does not know " + name);
        System.exit(1);
      }
      found.getConstructor(byte[].class).newInstance((Object) sealed(found));
    }
    System.exit(names.length > 0 ? 0 : 1);
  }

  private static LCMEncodable made(Class<?> type) throws Exception {
    LCMEncodable message = (LCMEncodable) type.getConstructor().newInstance();
    for (Field field : type.getFields()) {
      if (field.getType() == String.class) field.set(message, "cap01");
      if (LCMEncodable.class.isAssignableFrom(field.getType())) field.set(message, made(field.getType()));
      if (field.getType().isArray() && field.get(message) == null) {
        field.set(message, Array.newInstance(field.getType().getComponentType(), 0));
      }
    }
    return message;
  }

  private static byte[] sealed(Class<?> type) throws Exception {
    ByteArrayOutputStream bytes = new ByteArrayOutputStream();
    made(type).encode(new DataOutputStream(bytes));
    bytes.write(new byte[SEAL_SIZE]);
    return bytes.toByteArray();
  }
}
